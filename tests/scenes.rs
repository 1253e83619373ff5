//! The scenes that come with Welkin: each renders on this device by the mode that `auto` promises, without a word from
//! validation, and shows clouds.
mod support;

use support::{root, stderr, stdout, welkin};

#[test]
fn every_scene_renders_in_silence_and_shows_clouds() {
    let folder = tempfile::tempdir().unwrap();
    let mut scenes: Vec<_> = std::fs::read_dir(root().join("scenes")).unwrap().map(|e| e.unwrap().path()).collect();
    scenes.retain(|path| path.extension().is_some_and(|e| e == "toml"));
    scenes.sort();
    let output = welkin()
        .arg("render")
        .args(&scenes)
        .arg("-o")
        .arg(folder.path().join("out/"))
        .args("--size 160x90 --quality low --tables reduced --aux --stats".split(' '))
        .env("WELKIN_CACHE", folder.path().join("cache"))
        .output()
        .unwrap();
    assert!(output.status.success(), "{}", stderr(&output));
    let devices = welkin().args(["devices", "--json"]).output().unwrap();
    let devices: serde_json::Value = serde_json::from_str(&stdout(&devices)).unwrap();
    let reports: serde_json::Value = serde_json::from_str(&stdout(&output)).unwrap();
    let reports = reports.as_array().unwrap();
    assert!(scenes.len() >= 7 && reports.len() == scenes.len());
    for report in reports {
        let scene = &report["scene"];
        let device = devices["devices"].as_array().unwrap().iter().find(|d| d["name"] == report["device"]["name"]);
        assert_eq!(report["blend"]["used"], device.unwrap()["auto"], "{scene}");
        let reason = report["blend"]["reason"].as_str().unwrap();
        assert!(
            report["blend"]["used"] == "interlock" || reason.contains("VK_EXT_fragment_shader_interlock"),
            "{reason}"
        );
        assert_eq!(report["validation_messages"], 0, "{scene}: {}", stderr(&output));

        let picture = std::path::Path::new(report["output"].as_str().unwrap());
        let transmittance = std::fs::read(picture.with_extension("transmittance.npy")).unwrap();
        let transmittance: Vec<f32> = npyz::NpyFile::new(&transmittance[..]).unwrap().into_vec().unwrap();
        assert!(transmittance.iter().all(|t| (0.0..=1.0).contains(t)), "{scene}");
        let covered = transmittance.iter().filter(|t| **t < 0.5).count();
        assert!(
            covered * 100 > transmittance.len(),
            "{scene}: clouds cover {covered} of {} pixels",
            transmittance.len()
        );
    }
}
