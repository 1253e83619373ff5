//! What `welkin render --stats` reports. The keys are stable and documented in `docs/json.md`.

use std::collections::BTreeMap;

use serde::Serialize;

/// All that is known about one rendered scene.
#[derive(Clone, Debug, Default, PartialEq, Serialize)]
pub struct Stats {
    /// The scene file.
    pub scene: String,
    /// The picture file, or the first one of a sequence.
    pub output: String,
    /// Width of the picture [pixels].
    pub width: u32,
    /// Height of the picture [pixels].
    pub height: u32,
    /// What rendered it.
    pub device: DeviceStats,
    /// The compositing mode.
    pub blend: BlendStats,
    /// The pre-computed tables; `null` when the scene needs none.
    pub tables: Option<TableStats>,
    /// Counts of the last frame.
    pub particles: ParticleStats,
    /// Each growing list by name, after the last frame.
    pub capacity: BTreeMap<String, CapacityStats>,
    /// Times per pass, in the order they ran; the median over the frames.
    pub passes: Vec<PassStats>,
    /// Time of all passes [ms], the median over the frames; `null` without timestamps.
    pub frame_gpu_ms: Option<f64>,
    /// One entry per frame rendered.
    pub frames: Vec<FrameStats>,
    /// Device memory that the renderer holds [bytes].
    pub device_memory_bytes: u64,
    /// Messages of the validation layer, warnings included; `null` when the layer is not there.
    pub validation_messages: Option<u64>,
}

/// A device.
#[derive(Clone, Debug, Default, PartialEq, Serialize)]
pub struct DeviceStats {
    /// As the driver calls it.
    pub name: String,
    /// Driver name and version.
    pub driver: String,
    /// Vulkan version, for example `1.3.296`.
    pub api: String,
}

/// The compositing mode.
#[derive(Clone, Debug, Default, PartialEq, Serialize)]
pub struct BlendStats {
    /// What was asked for, `auto` included.
    pub requested: String,
    /// What was used.
    pub used: String,
    /// Why.
    pub reason: String,
}

/// The pre-computed tables.
#[derive(Clone, Debug, Default, PartialEq, Serialize)]
pub struct TableStats {
    /// `cache` or `built`.
    pub from: String,
    /// `full`, or `reduced` for a first picture while the full ones are still to be made.
    pub size: String,
    /// Time to read or build them [s].
    pub seconds: f64,
}

/// Counts of one frame.
#[derive(Clone, Debug, Default, PartialEq, Serialize)]
pub struct ParticleStats {
    /// Cells that were looked at.
    pub cells: u64,
    /// Cells with cloud in them.
    pub valid_cells: u64,
    /// Particles that were made or given.
    pub generated: u64,
    /// Particles inside the view.
    pub visible: u64,
}

/// How full a list is.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize)]
pub struct CapacityStats {
    /// Elements that the frame wanted to store.
    pub needed: u64,
    /// Elements that the list can hold.
    pub capacity: u64,
}

/// Time of one pass.
#[derive(Clone, Debug, Default, PartialEq, Serialize)]
pub struct PassStats {
    /// The pass.
    pub name: String,
    /// Time on the device [ms].
    pub gpu_ms: f64,
}

/// One frame of a sequence.
#[derive(Clone, Debug, Default, PartialEq, Serialize)]
pub struct FrameStats {
    /// Its number.
    pub frame: u32,
    /// The picture file.
    pub output: String,
    /// Time of all passes [ms]; `null` without timestamps.
    pub gpu_ms: Option<f64>,
    /// Time from the call to the picture in host memory [ms].
    pub wall_ms: f64,
    /// Size of the tables that lit it, `full` or `reduced`; `null` when the scene needs none.
    pub tables: Option<String>,
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_keys_of_the_contract_are_there() {
        let stats = Stats {
            capacity: [("valid_cells".to_owned(), CapacityStats { needed: 3, capacity: 4 })].into(),
            passes: vec![PassStats { name: "grid".into(), gpu_ms: 0.5 }],
            validation_messages: Some(0),
            ..Stats::default()
        };
        let json = serde_json::to_value(&stats).unwrap();
        for pointer in [
            "/device/name",
            "/device/driver",
            "/device/api",
            "/blend/requested",
            "/blend/used",
            "/blend/reason",
            "/particles/cells",
            "/particles/valid_cells",
            "/particles/generated",
            "/particles/visible",
            "/capacity/valid_cells/needed",
            "/capacity/valid_cells/capacity",
            "/passes/0/name",
            "/passes/0/gpu_ms",
            "/frame_gpu_ms",
            "/validation_messages",
        ] {
            assert!(json.pointer(pointer).is_some(), "{pointer} is missing");
        }
    }
}
