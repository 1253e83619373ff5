//! The Vulkan layer itself: resources, recording, derived barriers, timestamps, validation, leaks.

use welkin::Error;
use welkin::gpu::standalone::{Options, Standalone};
use welkin::gpu::{Buffer, BufferKind, ComputePipeline, Feature, Image, ImageDesc, MemoryUse, Once};
use welkin::shaders::probe_square_comp as square;

fn open() -> Standalone {
    Standalone::new(Options { validation: true, ..Options::default() }).expect("a device with validation")
}

#[repr(C)]
#[derive(Clone, Copy, bytemuck::Pod, bytemuck::Zeroable)]
struct Push {
    count: u32,
    scale: f32,
}

#[test]
fn a_program_runs_with_constants_and_every_resource_is_given_back() {
    let mut device = open();
    let gpu = device.gpu().clone();
    let before = gpu.memory_use();
    {
        let numbers: Vec<f32> = (0..1000).map(|i| i as f32).collect();
        let source = Buffer::upload(&gpu, "numbers", &numbers).unwrap();
        let squares = Buffer::array::<[f32; 4]>(&gpu, "squares", numbers.len()).unwrap();
        let readback = Buffer::new(&gpu, "readback", squares.size(), BufferKind::Readback).unwrap();
        let pipeline = ComputePipeline::new(&gpu, &square::PROGRAM, &[("OFFSET", 7)]).unwrap();
        device
            .frames()
            .run(|rec| {
                rec.pass("square", |rec| {
                    let bindings = square::Bindings { source: &source, squares: &squares };
                    rec.dispatch(&pipeline, &bindings, &Push { count: 1000, scale: 2.0 }, [1000, 1, 1])?;
                    rec.copy_buffer(&squares, &readback, squares.size());
                    rec.make_visible_to_host(&readback);
                    Ok(())
                })
            })
            .unwrap();
        for (i, element) in readback.read::<[f32; 4]>(0, numbers.len()).iter().enumerate() {
            assert_eq!(element[3], 2.0 * (i * i) as f32 + 7.0);
        }
        if gpu.capabilities().supports(Feature::Timestamps).is_ok() {
            let times = device.frames().state().times(0);
            assert_eq!(times.len(), 1);
            assert_eq!(times[0].name, "square");
        }
        assert_eq!(device.frames().state().last_pass(0), "square");
        assert_ne!(gpu.memory_use(), before);
    }
    assert_eq!(gpu.memory_use(), before);
    assert_eq!(device.messages().unwrap().all(), Vec::<String>::new());
    assert_ne!(before, MemoryUse::default()); // The trail of passes is alive.
}

#[test]
fn validation_is_awake() {
    // A canary: a use that is plainly wrong must be reported, or silence elsewhere would mean nothing.
    let mut device = open();
    let gpu = device.gpu().clone();
    let buffer = Buffer::array::<u32>(&gpu, "too small", 4).unwrap();
    device
        .frames()
        .run(|rec| {
            rec.fill_buffer(&buffer, 2, 8, 0); // The offset must be a multiple of 4.
            Ok(())
        })
        .unwrap();
    assert!(device.messages().unwrap().count() > 0);
}

#[test]
fn synchronization_validation_is_awake() {
    // A copy reads what a fill writes, recorded by hand without a barrier between them.
    let mut device = open();
    let gpu = device.gpu().clone();
    let a = Buffer::array::<u32>(&gpu, "a", 64).unwrap();
    let b = Buffer::array::<u32>(&gpu, "b", 64).unwrap();
    device
        .frames()
        .run(|rec| {
            let (cmd, device) = (rec.command_buffer(), rec.gpu().device().clone());
            let region = [ash::vk::BufferCopy { src_offset: 0, dst_offset: 0, size: 256 }];
            // SAFETY: the buffers are alive and large enough. The missing barrier is the point.
            unsafe {
                device.cmd_fill_buffer(cmd, a.handle(), 0, 256, 1);
                device.cmd_copy_buffer(cmd, a.handle(), b.handle(), &region);
            }
            Ok(())
        })
        .unwrap();
    let messages = device.messages().unwrap().all();
    assert!(messages.iter().any(|m| m.contains("READ_AFTER_WRITE") || m.contains("READ-AFTER-WRITE")), "{messages:?}");
}

#[test]
fn an_unknown_device_is_an_error_that_lists_the_devices() {
    let error = Standalone::new(Options { device: Some("Voodoo 2".into()), ..Options::default() }).err().unwrap();
    let text = error.to_string();
    assert!(text.contains("--device") && text.contains("Voodoo 2") && text.contains("0: "), "{text}");
}

#[test]
fn a_frame_whose_recording_fails_leaves_no_trace() {
    let mut device = open();
    let gpu = device.gpu().clone();
    let (format, usage) = (ash::vk::Format::R32_SFLOAT, ash::vk::ImageUsageFlags::STORAGE);
    let image = Image::new(&gpu, &ImageDesc { name: "image", extent: [4, 4, 0], format, usage }).unwrap();
    let readback = Buffer::new(&gpu, "readback", 64, BufferKind::Readback).unwrap();
    let failed = device.frames().submit::<()>(|rec| {
        rec.clear_image(&image, [1.0; 4]);
        Err(Error::invalid("frame", 1, "another"))
    });
    assert!(matches!(failed, Err(Error::InvalidParam { .. })));
    // The image has never left its undefined layout: the next frame has to bring it to its own.
    let run = device.frames().run(|rec| {
        rec.clear_image(&image, [2.0; 4]);
        rec.copy_image_to_buffer(&image, &readback);
        rec.make_visible_to_host(&readback);
        Ok(())
    });
    run.unwrap();
    assert_eq!(readback.read::<f32>(0, 16), [2.0; 16]);
    assert_eq!(device.messages().unwrap().all(), Vec::<String>::new());
}

#[test]
fn what_is_recorded_once_is_recorded_again_after_a_frame_that_was_not_submitted() {
    let mut device = open();
    let (once, mut times) = (Once::new(), 0);
    let mut record = |fails: bool| {
        let submitted = device.frames().run(|rec| {
            rec.once(&once, |_| {
                times += 1;
                Ok(())
            })?;
            if fails { Err(Error::invalid("frame", 1, "another")) } else { Ok(()) }
        });
        assert_eq!(submitted.is_err(), fails);
        times
    };
    assert_eq!([true, false, false, true, false].map(&mut record), [1, 2, 2, 2, 2]);
}

#[test]
fn a_buffer_dropped_in_flight_lives_until_its_frame_has_ended_and_its_memory_comes_back() {
    let mut device = open();
    let gpu = device.gpu().clone();
    let before = gpu.memory_use();
    let slots = device.frames().slots() as u64;
    for _ in 0..8 {
        let buffer = Buffer::array::<u32>(&gpu, "short-lived", 1 << 20).unwrap();
        let submitted = device.frames().submit(|rec| {
            rec.fill_buffer(&buffer, 0, buffer.size(), 1);
            Ok(())
        });
        submitted.unwrap();
        drop(buffer);
        // The frame may still write to it; those of earlier turns of the slots are gone.
        let kept = gpu.memory_use().allocations - before.allocations;
        assert!((1..=slots).contains(&kept), "{kept} buffers are kept");
    }
    device.frames().wait().unwrap();
    assert_eq!(gpu.memory_use(), before);
    assert_eq!(device.messages().unwrap().all(), Vec::<String>::new());
}
