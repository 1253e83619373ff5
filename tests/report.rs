//! The report of `welkin ab`, opened in a headless browser and clicked through.
#[path = "support/browser.rs"]
mod browser;
mod support;

use std::sync::Arc;

use browser::Browser;
use serde_json::{Value, json};
use welkin::compare::{Report, ReportSide, Series};
use welkin::output::Picture;

const WIDTH: u32 = 160;
const HEIGHT: u32 = 90;
const A: [f32; 3] = [0.8, 0.2, 0.2];
const B: [f32; 3] = [0.2, 0.4, 0.8];
const REFERENCE: [f32; 3] = [0.2, 0.6, 0.2];

/// One colour, brighter from frame to frame, with a white square at the left edge by which pixels can be told.
fn picture(colour: [f32; 3], frame: u32) -> Picture {
    let pixel = |x: u32, y: u32| {
        let white = x < 20 && y < 20;
        if white { [1.0; 3] } else { colour.map(|c| c + 0.02 * frame as f32) }
    };
    let radiance: Vec<_> = (0..WIDTH * HEIGHT).map(|i| pixel(i % WIDTH, i / WIDTH)).collect();
    Picture { width: WIDTH, height: HEIGHT, display: radiance.clone(), radiance, transmittance: None }
}

/// A report of `frames` frames in a directory of its own.
fn report(frames: u32) -> (tempfile::TempDir, std::path::PathBuf) {
    let directory = tempfile::tempdir().unwrap();
    let path = directory.path().join("report.html");
    let mut report = Report::new("</script><b>scene", "a device", [WIDTH, HEIGHT], "exact");
    let mut series = [Series::new("a"), Series::new("b")];
    for frame in 0..frames {
        let [a, b] = [A, B].map(|colour| Arc::new(picture(colour, frame)));
        let reference = Arc::new(picture(REFERENCE, frame).into());
        let differences =
            [series[0].add(frame, &a, &reference).unwrap(), series[1].add(frame, &b, &reference).unwrap()];
        report.add(frame, [&a, &b, &reference.picture], [&differences[0], &differences[1]]).unwrap();
    }
    let side = |name, series, ms| ReportSide { name, series, frame_gpu_ms: ms };
    report.write(&path, [side("mode-a", &series[0], Some(1.5)), side("mode-b", &series[1], None)]).unwrap();
    (directory, path)
}

/// 8-bit code of a colour in a frame.
fn code(colour: [f32; 3], frame: u32) -> [i64; 3] {
    colour.map(|c| ((c + 0.02 * frame as f32) * 255.0).round() as i64)
}

/// What the stage shows at a share of its width and height.
fn shown(browser: &mut Browser, x: f64, y: f64) -> [i64; 3] {
    // Through a canvas of its own: the stage's is not made for being read back, and the browser would remark on that.
    let script = format!(
        "(() => {{ const c = document.getElementById('canvas'), one = document.createElement('canvas'); \
         const context = one.getContext('2d', {{willReadFrequently: true}}); one.width = one.height = 1; \
         context.drawImage(c, -Math.floor(c.width * {x}), -Math.floor(c.height * {y})); \
         return Array.from(context.getImageData(0, 0, 1, 1).data); }})()"
    );
    let value = browser.value(&script);
    std::array::from_fn(|i| value[i].as_i64().unwrap())
}

/// The same up to the dither of 8-bit PNG files and the browser's interpolation: one code.
#[track_caller]
fn assert_shows(browser: &mut Browser, x: f64, expected: [i64; 3]) {
    let got = shown(browser, x, 0.5);
    assert!((0..3).all(|i| (got[i] - expected[i]).abs() <= 1), "at {x}: {got:?}, expected {expected:?}");
}

fn text(browser: &mut Browser, selector: &str) -> String {
    browser.value(&format!("document.querySelector({selector:?}).textContent")).as_str().unwrap().to_owned()
}

fn open(frames: u32) -> Option<(tempfile::TempDir, Browser)> {
    let (directory, path) = report(frames);
    let mut browser = Browser::open(&path, 1100, 900)?;
    browser.until("document.readyState === 'complete' && shown !== null");
    Some((directory, browser))
}

#[track_caller]
fn silent(browser: &Browser) {
    assert_eq!(browser.complaints, Vec::<String>::new());
}

#[test]
fn the_divider_is_dragged_and_moved_by_keys() {
    let Some((_directory, mut browser)) = open(1) else { return };
    assert_shows(&mut browser, 0.48, code(A, 0));
    assert_shows(&mut browser, 0.52, code(B, 0));
    assert_eq!(text(&mut browser, "#scene"), "</script><b>scene");
    assert_eq!(text(&mut browser, "#tag-left"), "a: mode-a");
    assert_eq!(browser.value("document.getElementById('frames').hidden"), json!(true));

    let stage = browser.centre("#canvas");
    let width = browser.value("document.getElementById('canvas').clientWidth").as_f64().unwrap();
    let handle = browser.centre("#divider");
    let before = browser.screenshot();
    browser.drag(handle, [stage[0] + 0.3 * width, handle[1]]);
    assert_eq!(browser.value("document.getElementById('divider').getAttribute('aria-valuenow')"), json!("80"));
    assert_shows(&mut browser, 0.78, code(A, 0));
    assert_shows(&mut browser, 0.82, code(B, 0));
    assert!(browser.screenshot() != before, "the window looks the same after the drag");

    // The divider has the focus from the drag.
    browser.key("ArrowLeft");
    assert_eq!(browser.value("document.getElementById('divider').getAttribute('aria-valuenow')"), json!("79"));
    browser.key("Home");
    assert_shows(&mut browser, 0.02, code(B, 0));
    browser.key("End");
    assert_shows(&mut browser, 0.98, code(A, 0));
    silent(&browser);
}

#[test]
fn sides_heat_maps_and_figures_are_shown() {
    let Some((_directory, mut browser)) = open(1) else { return };
    browser.key("r"); // The reference on the left.
    assert_shows(&mut browser, 0.3, code(REFERENCE, 0));
    assert_eq!(browser.value("document.getElementById('left').value"), json!("2"));
    browser.key("a");
    assert_eq!(browser.value("document.getElementById('legend').hidden"), json!(true));
    browser.click("[data-heat='0']");
    assert_eq!(browser.value("document.getElementById('legend').hidden"), json!(false));
    let flip = shown(&mut browser, 0.3, 0.5);
    assert!(flip != code(A, 0) && flip != shown(&mut browser, 0.7, 0.5), "{flip:?}");
    browser.click("[data-heat='1']");
    // |0.8 − 0.2| is 0.96 of six decades, |0.8 − 0.2| of b as well: the same colour on both sides.
    let expected = welkin::compare::magma((255.0 * (1.0 + 0.6f64.log10() / 6.0)).round() as u8).map(i64::from);
    assert_shows(&mut browser, 0.3, expected);
    assert_shows(&mut browser, 0.7, expected);
    assert!(text(&mut browser, "#legend-scale").contains("1e-3"));
    browser.key("h");
    assert_shows(&mut browser, 0.3, code(A, 0));

    let rows: Value = browser.value("Array.from(document.querySelectorAll('#figures tr'), r => r.innerText)");
    let rows: Vec<_> = rows.as_array().unwrap().iter().map(|row| row.as_str().unwrap().replace('\n', " ")).collect();
    let all = rows.join("|");
    for name in ["RMSE", "relative MSE", "PSNR", "ꟻLIP", "greatest difference", "time"] {
        assert!(all.contains(name), "{name} is missing: {all}");
    }
    assert!(!all.contains("popping") && all.contains("1.5"), "{all}"); // One frame has none.
    silent(&browser);
}

#[test]
fn zoom_pan_and_read_out_follow_the_mouse() {
    let Some((_directory, mut browser)) = open(1) else { return };
    browser.click("#one");
    assert_eq!(text(&mut browser, "#scale"), "100 %");
    let stage = browser.centre("#canvas");
    browser.hover([stage[0] - 70.5, stage[1] - 35.5]); // Pixel 9, 9 at one to one.
    assert!(text(&mut browser, "#readout").starts_with("pixel 9, 9"), "{}", text(&mut browser, "#readout"));
    assert_eq!(
        browser.value("document.querySelector('[data-of=b]').innerText.trim().slice(0, 13)"),
        json!("b 255 255 255")
    );
    browser.hover([stage[0] + 40.5, stage[1]]);
    let [r, g, b] = code(B, 0);
    let readout = text(&mut browser, "#readout");
    assert!(readout.contains(&format!("b {r} {g} {b}")) && readout.contains("ꟻLIP"), "{readout}");

    // Dragged by 30 pixels, the same place shows what was 30 pixels to the left.
    browser.drag([stage[0] - 60.0, stage[1]], [stage[0] - 30.0, stage[1]]);
    browser.hover([stage[0] - 40.5, stage[1] - 35.5]);
    assert!(text(&mut browser, "#readout").starts_with("pixel 9, 9"), "{}", text(&mut browser, "#readout"));

    // The wheel zooms about the mouse: the pixel under it stays.
    let wheel = json!({"type": "mouseWheel", "x": stage[0] - 40.5, "y": stage[1] - 35.5, "deltaX": 0, "deltaY": -480});
    browser.call("Input.dispatchMouseEvent", wheel);
    browser.until("document.getElementById('scale').textContent === '400 %'");
    assert!(text(&mut browser, "#readout").starts_with("pixel 9, 9"), "{}", text(&mut browser, "#readout"));
    browser.key("0");
    assert!(text(&mut browser, "#scale") != "400 %");

    let theme = |browser: &mut Browser| browser.value("document.documentElement.dataset.theme");
    let before = theme(&mut browser);
    browser.click("#theme");
    assert_ne!(theme(&mut browser), before);
    silent(&browser);
}

#[test]
fn frames_are_stepped_through_and_charted() {
    let Some((_directory, mut browser)) = open(4) else { return };
    assert!(text(&mut browser, "#number").starts_with("0 of 0–3"));
    browser.key("]");
    browser.until("document.getElementById('number').textContent.startsWith('1 ')");
    assert_shows(&mut browser, 0.3, code(A, 1));
    browser.key("[");
    browser.key("[");
    browser.until("document.getElementById('number').textContent.startsWith('3 ')");
    assert_shows(&mut browser, 0.3, code(A, 3));
    assert_eq!(browser.value("document.querySelectorAll('#chart polyline').length"), json!(2));
    let before = text(&mut browser, "#chart-name");
    browser.click("#figures tr:nth-child(6) button");
    assert!(before.starts_with("RMSE") && text(&mut browser, "#chart-name").starts_with("popping"));
    browser.click("#play");
    browser.until("document.getElementById('number').textContent.startsWith('1 ')");
    browser.click("#play");
    assert_eq!(browser.value("document.getElementById('play').textContent"), json!("▶"));
    silent(&browser);
}
