//! The coverage field (`glsl/density/field.glsl`), bit for bit.
//!
//! `f32` with one rounding per operation, in the shader's order: which cells hold cloud is an integer decision, and host
//! and device must take the same.

/// PCG-RXS-M-XS as a hash (O'Neill 2014).
#[must_use]
pub fn pcg(v: u32) -> u32 {
    let state = v.wrapping_mul(747_796_405).wrapping_add(2_891_336_453);
    let word = ((state >> ((state >> 28) + 4)) ^ state).wrapping_mul(277_803_737);
    (word >> 22) ^ word
}

/// Hash of a lattice point.
#[must_use]
pub fn hash_lattice(point: [i32; 2], seed: u32) -> u32 {
    pcg((point[0] as u32).wrapping_add(pcg((point[1] as u32).wrapping_add(pcg(seed)))))
}

/// Uniform in [0, 1).
#[must_use]
pub fn unit_float(hash: u32) -> f32 {
    (hash >> 8) as f32 * 5.960_464_5e-8
}

/// Uniform in [-1, 1).
#[must_use]
pub fn signed_float(hash: u32) -> f32 {
    (hash >> 8) as f32 * 1.192_092_9e-7 - 1.0
}

/// Lattice cell and the place in it, 0 to 1.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct LatticePoint {
    /// Lattice cell (x, z).
    pub cell: [i32; 2],
    /// Fraction within the cell.
    pub fraction: [f32; 2],
}

/// Splits position × frequency, a 64-bit product, into cell and fraction.
#[must_use]
pub fn lattice_point(position: [i32; 2], frequency: i32) -> LatticePoint {
    let product = position.map(|axis| i64::from(axis) * i64::from(frequency));
    LatticePoint { cell: product.map(|p| (p >> 32) as i32), fraction: product.map(|p| unit_float(p as u32)) }
}

/// A random number that moves with time: `start`, 31 bits, walks to and fro over its range at a pace of its own, so that an
/// even distribution stays one. 24 bits; at phase 0 the upper ones of `start`. 2²⁴ of the phase are a life.
#[must_use]
pub fn walk(start: u32, pace: u32, phase: u32) -> u32 {
    let way = phase.wrapping_mul(64 + (pace & 127));
    let at = if pace & 128 == 0 { start.wrapping_add(way) } else { start.wrapping_sub(way) };
    (if at >= 0x8000_0000 { !at } else { at }) >> 7
}

/// The point of a lattice that is turned: its axes point along (`along`, `across`) and (−`across`, `along`), in 2⁻³² lattice
/// cells per step, and the position 0 lies `half_cells` half cells from its first point. Exact, as [`lattice_point`].
#[must_use]
pub fn turned_lattice_point(position: [i32; 2], along: i32, across: i32, half_cells: [i32; 2]) -> LatticePoint {
    let [x, z] = position.map(i64::from);
    let (along, across) = (i64::from(along), i64::from(across));
    let axis = |half_cells: i32, product: i64| product.wrapping_add(i64::from(half_cells) << 31);
    let sums = [axis(half_cells[0], x * along + z * across), axis(half_cells[1], z * along - x * across)];
    LatticePoint { cell: sums.map(|s| (s >> 32) as i32), fraction: sums.map(|s| unit_float(s as u32)) }
}

fn quintic(f: f32) -> f32 {
    let cube = (f * f) * f;
    let slope = f * 6.0 - 15.0;
    cube * (f * slope + 10.0)
}

fn lattice_gradient(corner: [i32; 2], x: f32, z: f32, seed: u32, phase: u32) -> f32 {
    let hash = hash_lattice(corner, seed);
    let pace = pcg(hash);
    let gx = walk((hash & 0xffff) << 15, pace, phase) as f32 * 1.192_092_9e-7 - 1.0;
    let gz = walk(hash >> 16 << 15, pace >> 8, phase) as f32 * 1.192_092_9e-7 - 1.0;
    gx * x + gz * z
}

/// Gradient noise, zero mean, mostly within ±0.6.
#[must_use]
pub fn gradient_noise(p: LatticePoint, seed: u32, phase: u32) -> f32 {
    let [x, z] = p.fraction;
    let (x1, z1) = (x - 1.0, z - 1.0);
    let corner = |dx: i32, dz: i32| [p.cell[0].wrapping_add(dx), p.cell[1].wrapping_add(dz)];
    let a = lattice_gradient(corner(0, 0), x, z, seed, phase);
    let b = lattice_gradient(corner(1, 0), x1, z, seed, phase);
    let c = lattice_gradient(corner(0, 1), x, z1, seed, phase);
    let d = lattice_gradient(corner(1, 1), x1, z1, seed, phase);
    let (u, v) = (quintic(x), quintic(z));
    let ab = a + u * (b - a);
    let cd = c + u * (d - c);
    ab + v * (cd - ab)
}

/// One round heap per lattice cell; the highest of the nine nearest, at least 0.
#[must_use]
pub fn heaps(p: LatticePoint, seed: u32, phase: u32) -> f32 {
    let mut highest = 0.0f32;
    for dz in -1..=1 {
        for dx in -1..=1 {
            let hash = hash_lattice([p.cell[0].wrapping_add(dx), p.cell[1].wrapping_add(dz)], seed);
            let shape = pcg(hash);
            let pace = pcg(shape);
            let place_x = walk((hash & 0xffff) << 15, pace, phase) as f32 * 4.172_325e-8 + 0.15;
            let place_z = walk(hash >> 16 << 15, pace >> 8, phase) as f32 * 4.172_325e-8 + 0.15;
            let x = (dx as f32 - p.fraction[0]) + place_x;
            let z = (dz as f32 - p.fraction[1]) + place_z;
            let narrow = walk(shape >> 8 << 7, pace >> 16, phase) as f32 * 5.960_464_5e-8;
            let inverse_r2 = (narrow * narrow) * 2.6 + 0.85;
            let height = 1.0 - narrow * 0.55;
            let d2 = x * x + z * z;
            highest = highest.max(height * (1.0 - d2 * inverse_r2));
        }
    }
    highest
}

/// Frequencies of the field's noises, in 2⁻³² lattice cells per position step.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct FieldFrequencies {
    /// Heaps.
    pub heap: i32,
    /// Outline; its two octaves double the frequency.
    pub billow: i32,
    /// Turrets on a heap.
    pub turret: i32,
    /// Clusters of heaps.
    pub streak: i32,
    /// Weather.
    pub region: i32,
    /// Phase of what grows and dissolves, 2⁻²⁴ lives; see [`walk`].
    pub phase: u32,
    /// The same of streaks and weather, which are slower.
    pub weather_phase: u32,
}

/// Positive far inside a cloud, lowest in clear sky. `resolved`: share of fine detail that the caller's cells can show; 1
/// is the field itself.
#[must_use]
pub fn coverage_field(position: [i32; 2], f: FieldFrequencies, seed: u32, resolved: f32) -> f32 {
    let octave = |index: u32| seed.wrapping_add(index);
    let heap = heaps(lattice_point(position, f.heap), seed, f.phase) * 1.35;
    let n1 = gradient_noise(lattice_point(position, f.billow), octave(1), f.phase) * 0.5;
    let n2 =
        gradient_noise(lattice_point(position, f.billow * 2), octave(2), f.phase.wrapping_mul(2)) * 0.28 * resolved;
    let n3 = gradient_noise(lattice_point(position, f.billow * 4), octave(3), f.phase.wrapping_mul(4))
        * 0.15
        * resolved
        * resolved;
    let streak = gradient_noise(lattice_point(position, f.streak), octave(4), f.weather_phase) + 0.75;
    let region = gradient_noise(lattice_point(position, f.region), octave(5), f.weather_phase) + 1.0;
    let weather = (streak * region) * 0.55;
    let outline = (n1 + n2) + n3;
    (heap + outline) + weather
}

/// Height of the turrets that stand on a heap, 0 to 1.
#[must_use]
pub fn turret_field(position: [i32; 2], f: FieldFrequencies, seed: u32) -> f32 {
    heaps(lattice_point(position, f.turret), seed.wrapping_add(6), f.phase)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_hash_scatters_neighbouring_inputs_over_all_bits() {
        for bit in 0..32 {
            let flips: u32 = (0..1024u32).map(|v| (pcg(v) ^ pcg(v ^ (1 << bit))).count_ones()).sum();
            // 1024 × 32 fair coins: mean 16384, standard deviation 90; six of them.
            assert!((15_844..=16_924).contains(&flips), "bit {bit}: {flips} flips");
        }
    }

    #[test]
    fn a_lattice_point_is_exact_far_from_the_origin_and_below_zero() {
        let frequency = 1 << 20; // one lattice cell is 4096 steps
        let p = lattice_point([-1, 4096 * 500_000 + 1024], frequency);
        assert_eq!(p.cell, [-1, 500_000]);
        assert_eq!(p.fraction, [4095.0 / 4096.0, 0.25]);
    }

    #[test]
    fn a_turned_lattice_point_is_the_rotation_about_its_centre() {
        // 4096 steps a cell; 5 × 4 points, so that the centre lies on a point along one axis and between two along the other.
        let frequency = f64::from(1 << 20);
        for degrees in [0.0_f64, 37.0, 90.0, -135.0, 360.0] {
            let (sin, cos) = degrees.to_radians().sin_cos();
            let (along, across) = ((frequency * cos).round() as i32, (frequency * sin).round() as i32);
            for position in [[0, 0], [700_000, -123_456], [-5, 4096], [-70_000_000, 70_000_000]] {
                let p = turned_lattice_point(position, along, across, [4, 3]);
                let [x, z] = position.map(|axis| f64::from(axis) / 4096.0);
                let expected = [2.0 + x * cos + z * sin, 1.5 + z * cos - x * sin];
                for axis in 0..2 {
                    let at = f64::from(p.cell[axis]) + f64::from(p.fraction[axis]);
                    // Half a unit of either frequency's rounding over 7e7 steps, and 24 bits of fraction.
                    let bound = 1.2e-7 + 7.0e7 / 4_294_967_296.0;
                    assert!((at - expected[axis]).abs() < bound, "{degrees}°, {position:?}: {at} {expected:?}");
                }
            }
        }
        let straight = turned_lattice_point([4096 * 7 + 1024, -4096], 1 << 20, 0, [0, 0]);
        assert_eq!(straight, lattice_point([4096 * 7 + 1024, -4096], 1 << 20));
    }

    #[test]
    fn the_field_is_continuous_across_lattice_borders() {
        let f = FieldFrequencies {
            heap: 1 << 22,
            billow: 1 << 23,
            turret: 1 << 23,
            streak: 1 << 19,
            region: 1 << 16,
            phase: 0,
            weather_phase: 0,
        };
        let mut previous = coverage_field([-5000, 777], f, 3, 1.0);
        for x in -4999..5000 {
            let value = coverage_field([x, 777], f, 3, 1.0);
            // The steepest slope: heaps 2·1.09·√(3.45)·(2⁻¹⁰ a step) and noise, below 0.02 a step of this size.
            assert!((value - previous).abs() < 0.02, "jump of {} at {x}", value - previous);
            previous = value;
        }
    }

    #[test]
    fn a_walk_keeps_an_even_distribution_even_and_starts_where_it_stands() {
        for phase in [0, 1 << 22, 1 << 24, 77 << 24, u32::MAX] {
            let mut counts = [0; 16];
            (0..16_384u32).for_each(|i| counts[(walk(pcg(i) >> 1, pcg(i + 99_999), phase) >> 20) as usize] += 1);
            // Mean 1024, standard deviation 31; five of them.
            assert!(counts.iter().all(|&count| (869..=1179).contains(&count)), "phase {phase}: {counts:?}");
        }
        assert_eq!(walk(0x1234_5678, 200, 0), 0x1234_5678 >> 7);
    }

    #[test]
    fn the_field_changes_smoothly_with_time_through_the_end_of_its_period() {
        let at = |phase: u32| {
            let (heap, billow, turret, streak, region) = (1 << 22, 1 << 23, 1 << 23, 1 << 19, 1 << 16);
            let f = FieldFrequencies { heap, billow, turret, streak, region, phase, weather_phase: phase };
            [[-5000, 777], [123, 4567], [88_000, -3]].map(|place| coverage_field(place, f, 3, 1.0))
        };
        let mut moved = 0.0f32;
        for step in 0..2000u32 {
            let phase = (step << 14).wrapping_sub(1000 << 14); // 2⁻¹⁰ lives a step, across 0
            let (before, after) = (at(phase), at(phase.wrapping_add(1 << 14)));
            for (a, b) in before.iter().zip(after) {
                // A heap moves at most 1.5 · 0.7 cells a life in each axis, with a slope below 4; noises add less.
                assert!((a - b).abs() < 0.015, "{a} {b} at {phase}");
                moved += (a - b).abs();
            }
        }
        assert!(moved > 1.0, "{moved}");
    }
}
