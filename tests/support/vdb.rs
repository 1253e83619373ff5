//! A strict reader of OpenVDB files with one uncompressed float grid, written from the format's description and against
//! files of OpenVDB 10: every byte must be accounted for.

use std::collections::HashMap;

pub struct Grid {
    pub name: String,
    pub metadata: HashMap<String, Vec<u8>>,
    /// World position of the centre of voxel (0, 0, 0).
    pub first_centre: [f64; 3],
    pub scale: f64,
    /// By place in leaves; z fastest.
    pub leaves: HashMap<[u32; 3], Vec<f32>>,
}

struct Reader<'a> {
    bytes: &'a [u8],
    at: usize,
}

impl<'a> Reader<'a> {
    fn take(&mut self, count: usize) -> &'a [u8] {
        self.at += count;
        &self.bytes[self.at - count..self.at]
    }

    fn array<const N: usize>(&mut self) -> [u8; N] {
        self.take(N).try_into().unwrap()
    }

    fn u32(&mut self) -> u32 {
        u32::from_le_bytes(self.array())
    }

    fn u64(&mut self) -> u64 {
        u64::from_le_bytes(self.array())
    }

    fn f32(&mut self) -> f32 {
        f32::from_le_bytes(self.array())
    }

    fn vector(&mut self) -> [f64; 3] {
        [0; 3].map(|_| f64::from_le_bytes(self.array()))
    }

    fn text(&mut self) -> String {
        let length = self.u32() as usize;
        String::from_utf8(self.take(length).to_vec()).unwrap()
    }

    fn metadata(&mut self) -> HashMap<String, Vec<u8>> {
        let count = self.u32();
        (0..count)
            .map(|_| {
                let (name, kind) = (self.text(), self.text());
                let length = self.u32() as usize;
                let fixed = match kind.as_str() {
                    "bool" => Some(1),
                    "int64" => Some(8),
                    "vec3i" => Some(12),
                    "string" => None,
                    other => panic!("metadata of type {other}"),
                };
                assert!(fixed.is_none_or(|fixed| fixed == length), "{name}");
                (name, self.take(length).to_vec())
            })
            .collect()
    }

    /// Indices of set bits.
    fn mask(&mut self, bits: usize) -> Vec<usize> {
        let bytes = self.take(bits / 8);
        (0..bits).filter(|bit| bytes[bit / 8] >> (bit % 8) & 1 == 1).collect()
    }

    /// Children of a node of `side`³, by offset in children.
    fn inner(&mut self, side: usize) -> Vec<[u32; 3]> {
        let children = self.mask(side.pow(3));
        assert!(self.mask(side.pow(3)).is_empty(), "active tiles");
        assert_eq!(self.take(1), [0], "inactive values are the background, and no active ones follow");
        children.into_iter().map(|i| [i / (side * side), i / side % side, i % side].map(|c| c as u32)).collect()
    }
}

pub fn read(bytes: &[u8]) -> Grid {
    let r = &mut Reader { bytes, at: 0 };
    assert_eq!((r.take(8), r.u32()), (&b" BDV\0\0\0\0"[..], 224));
    r.take(8); // library version
    assert_eq!(r.take(1), [1], "offsets are given");
    let uuid = std::str::from_utf8(r.take(36)).unwrap();
    assert!(uuid.split('-').map(str::len).eq([8, 4, 4, 4, 12]), "{uuid}");
    r.metadata();
    assert_eq!(r.u32(), 1, "grids");
    let name = r.text();
    assert_eq!((r.text().as_str(), r.text().as_str()), ("Tree_float_5_4_3", ""));
    let [start, buffers, end] = [r.u64(), r.u64(), r.u64()];
    assert_eq!((start, end), (r.at as u64, bytes.len() as u64));

    assert_eq!(r.u32(), 2, "only active values are stored, uncompressed");
    let metadata = r.metadata();
    assert_eq!(r.text(), "UniformScaleTranslateMap");
    let [first_centre, scale, voxel, inverse, inverse_square, half_inverse] = [0; 6].map(|_| r.vector());
    let s = scale[0];
    for (vector, value) in
        [(scale, s), (voxel, s), (inverse, 1.0 / s), (inverse_square, 1.0 / (s * s)), (half_inverse, 0.5 / s)]
    {
        assert_eq!(vector, [value; 3]);
    }

    assert_eq!((r.u32(), r.f32(), r.u32()), (1, 0.0, 0), "a buffer a leaf, background, tiles of the root");
    let mut masks = Vec::new();
    for _ in 0..r.u32() {
        let root = [r.u32(), r.u32(), r.u32()];
        assert!(root.iter().all(|c| c % 4096 == 0));
        for node in r.inner(32) {
            for leaf in r.inner(16) {
                let at: [u32; 3] = std::array::from_fn(|axis| root[axis] / 8 + node[axis] * 16 + leaf[axis]);
                masks.push((at, r.mask(512)));
            }
        }
    }
    assert_eq!(r.at as u64, buffers);
    let mut leaves = HashMap::new();
    for (at, mask) in masks {
        assert_eq!(r.mask(512), mask, "the mask stands twice");
        assert_eq!(r.take(1), [0]);
        let mut values = vec![0.0; 512];
        mask.iter().for_each(|&index| values[index] = r.f32());
        assert!(leaves.insert(at, values).is_none());
    }
    assert_eq!(r.at, bytes.len());
    Grid { name, metadata, first_centre, scale: s, leaves }
}
