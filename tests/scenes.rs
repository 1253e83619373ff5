//! The scenes that come with Welkin: each renders on this device by the mode that `auto` promises, without a word from
//! validation, and shows clouds.
mod support;

use std::path::Path;

use support::{root, stderr, stdout, welkin};

#[test]
fn every_scene_renders_in_silence_and_shows_clouds() {
    let folder = tempfile::tempdir().unwrap();
    let mut scenes: Vec<_> = std::fs::read_dir(root().join("scenes")).unwrap().map(|e| e.unwrap().path()).collect();
    scenes.retain(|path| path.extension().is_some_and(|e| e == "toml") && scatter_command(path).is_none());
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

/// The command that makes the particles of a scene, as the scene's comment has it, if there is one.
fn scatter_command(scene: &Path) -> Option<Vec<String>> {
    let text = std::fs::read_to_string(scene).unwrap();
    let line = text.lines().find_map(|line| line.trim_start_matches(['#', ' ']).strip_prefix("welkin scatter "))?;
    Some(line.split(' ').map(str::to_owned).collect())
}

#[test]
fn a_field_of_clouds_is_made_by_the_command_that_its_scene_tells_and_then_renders() {
    let folder = tempfile::tempdir().unwrap();
    std::fs::create_dir(folder.path().join("scenes")).unwrap();
    for (name, particles) in [("shimada-9382", 9382), ("shimada-32914", 32_914)] {
        let scene = folder.path().join(format!("scenes/{name}.toml"));
        std::fs::copy(root().join(format!("scenes/{name}.toml")), &scene).unwrap();
        let render = || {
            let mut command = welkin();
            let line = "--size 160x90 --tables reduced --aux --stats".split(' ');
            command.current_dir(folder.path()).arg("render").arg(&scene).args(["-o", "a.npy"]).args(line);
            command.env("WELKIN_CACHE", folder.path().join("cache"));
            command.output().unwrap()
        };
        let before = render();
        assert_eq!(before.status.code(), Some(2));
        let message = stderr(&before);
        assert!(message.contains(&format!("{name}.csv")) && message.contains("`welkin scatter` makes"), "{message}");

        let command = scatter_command(&scene).unwrap();
        let made = welkin().current_dir(folder.path()).arg("scatter").args(command).output().unwrap();
        assert!(made.status.success(), "{}", stderr(&made));
        let output = render();
        assert!(output.status.success(), "{}", stderr(&output));
        let report: serde_json::Value = serde_json::from_str(&stdout(&output)).unwrap();
        assert_eq!((&report["particles"]["generated"], &report["validation_messages"]), (&particles.into(), &0.into()));
        let transmittance = std::fs::read(folder.path().join("a.transmittance.npy")).unwrap();
        let transmittance: Vec<f32> = npyz::NpyFile::new(&transmittance[..]).unwrap().into_vec().unwrap();
        let covered = transmittance.iter().filter(|t| **t < 0.5).count();
        assert!(covered * 10 > transmittance.len(), "{name}: clouds cover {covered} of {} pixels", transmittance.len());
    }
}
