//! OpenVDB files: one sparse grid of f32 as a tree 5-4-3, file version 224 (OpenVDB 5 and later, Blender, Houdini).
//!
//! A file names its grids, then holds each grid's settings, metadata, transform, topology (which nodes exist, which voxels
//! are active) and buffers (the values), in this order. Values of inactive voxels are the background, 0, and are left out
//! ("active mask" compression); nothing is packed further. Everything is little-endian.
//!
//! Leaves are written to a temporary file as they come and copied behind the topology in the end, so memory holds 80 bytes
//! a leaf, not its 2 KiB.

use std::fs::File;
use std::io::{self, BufWriter, Seek, Write};
use std::path::{Path, PathBuf};

use super::atomic::{AtomicFile, directory_of};
use crate::{Error, Result};

/// Voxels of a leaf.
pub const LEAF_VOXELS: usize = 512;

/// What a grid is, besides its voxels.
#[derive(Clone, Debug, PartialEq)]
pub struct VdbGrid {
    /// Name, `density` for most programs.
    pub name: String,
    /// Least corner of voxel (0, 0, 0) [m]. (In OpenVDB a voxel's index is its centre.)
    pub corner: [f64; 3],
    /// Edge of a voxel [m].
    pub voxel: f64,
    /// More metadata: name and text.
    pub notes: Vec<(String, String)>,
}

/// A leaf: its place in leaves and which of its voxels are active.
struct Leaf {
    at: [u32; 3],
    mask: [u64; 8],
}

/// Collects the leaves of a grid.
pub struct VdbWriter {
    path: PathBuf,
    values: BufWriter<File>,
    leaves: Vec<Leaf>,
    hash: blake3::Hasher,
}

/// `VDB ` as a little-endian 64-bit number.
const MAGIC: u64 = 0x5644_4220;
const FILE_VERSION: u32 = 224;
/// The library version that the file says it was written by: the first that writes file version 224.
const LIBRARY_VERSION: [u32; 2] = [5, 0];
/// Values of inactive voxels are left out.
const COMPRESS_ACTIVE_MASK: u32 = 2;
/// Inactive voxels all have the background's value.
const INACTIVE_ARE_BACKGROUND: u8 = 0;
/// Leaves along the edge of a node above them, and of those along the edge of the one above that.
const NODE_LEAVES: u32 = 16;
const UPPER_NODES: u32 = 32;

impl VdbWriter {
    /// Starts a file for `path`; values go to a nameless file in the same directory until then.
    ///
    /// # Errors
    /// [`Error::File`] when the directory cannot be written.
    pub fn create(path: &Path) -> Result<Self> {
        let values = tempfile::tempfile_in(directory_of(path))
            .map_err(|error| Error::file(path, format!("cannot be written: {error}")))?;
        Ok(Self {
            path: path.to_owned(),
            values: BufWriter::new(values),
            leaves: Vec::new(),
            hash: blake3::Hasher::new(),
        })
    }

    /// Adds the leaf at `at` (in leaves of 8³ voxels, from voxel 0) unless all its voxels are 0. `values`: z fastest, then y,
    /// then x.
    ///
    /// # Errors
    /// [`Error::File`] when the disk fails.
    ///
    /// # Panics
    /// If there are not [`LEAF_VOXELS`] values, or if a leaf comes before the last one in the order of the tree: upper nodes
    /// of 512³ leaves, x slowest, in these nodes of 16³ leaves, x slowest, in these leaves, x slowest.
    pub fn leaf(&mut self, at: [u32; 3], values: &[f32]) -> Result<()> {
        assert_eq!(values.len(), LEAF_VOXELS, "a leaf has 8³ values");
        let after = self.leaves.last().is_none_or(|last| tree_order(last.at) < tree_order(at));
        assert!(after, "leaf {at:?} comes out of order");
        let mut mask = [0u64; 8];
        for (index, _) in values.iter().enumerate().filter(|(_, value)| **value != 0.0) {
            mask[index / 64] |= 1 << (index % 64);
        }
        if mask == [0; 8] {
            return Ok(());
        }
        let mut bytes = Vec::with_capacity(64 + 1 + 4 * LEAF_VOXELS);
        words(&mut bytes, &mask);
        bytes.push(INACTIVE_ARE_BACKGROUND);
        values.iter().filter(|value| **value != 0.0).for_each(|value| bytes.extend(value.to_le_bytes()));
        self.hash.update(bytemuck::bytes_of(&at));
        self.hash.update(&bytes);
        self.leaves.push(Leaf { at, mask });
        self.values.write_all(&bytes).map_err(|error| self.fault(&error))
    }

    /// Number of active voxels so far.
    #[must_use]
    pub fn active_voxels(&self) -> u64 {
        self.leaves.iter().flat_map(|leaf| leaf.mask).map(|word| u64::from(word.count_ones())).sum()
    }

    /// Writes the file.
    ///
    /// # Errors
    /// [`Error::File`] when the disk fails.
    pub fn finish(mut self, grid: &VdbGrid) -> Result<()> {
        let before = self.before_values(grid);
        let mut file = AtomicFile::create(&self.path)?;
        let mut write = || -> io::Result<()> {
            file.write_all(&before)?;
            self.values.flush()?;
            let values = self.values.get_mut();
            values.rewind()?;
            io::copy(values, &mut file).map(drop)
        };
        write().map_err(|error| file.fault(&error))?;
        file.commit()
    }

    fn fault(&self, error: &io::Error) -> Error {
        Error::file(&self.path, format!("cannot be written: {error}"))
    }

    /// Everything that comes before the buffers.
    fn before_values(&self, grid: &VdbGrid) -> Vec<u8> {
        let mut out = Vec::new();
        out.extend(MAGIC.to_le_bytes());
        number(&mut out, FILE_VERSION);
        LIBRARY_VERSION.iter().for_each(|&v| number(&mut out, v));
        out.push(1); // The places of grids are given.
        out.extend(self.uuid().as_bytes());
        let creator = concat!("welkin ", env!("CARGO_PKG_VERSION"));
        metadata(&mut out, &[("creator", "string", creator.as_bytes().to_vec())]);
        number(&mut out, 1); // grids
        text(&mut out, &grid.name);
        text(&mut out, "Tree_float_5_4_3");
        text(&mut out, ""); // It is an instance of no other grid.

        let mut body = Vec::new();
        number(&mut body, COMPRESS_ACTIVE_MASK);
        self.grid_metadata(&mut body, grid);
        transform(&mut body, grid);
        self.topology(&mut body);
        // Where the grid, its buffers and its end lie.
        let start = out.len() as u64 + 24;
        let buffers = start + body.len() as u64;
        let end = buffers + self.value_bytes();
        [start, buffers, end].iter().for_each(|place| out.extend(place.to_le_bytes()));
        out.extend(body);
        out
    }

    fn value_bytes(&self) -> u64 {
        65 * self.leaves.len() as u64 + 4 * self.active_voxels()
    }

    /// A name for the contents: equal grids have equal files.
    fn uuid(&self) -> String {
        let hash = self.hash.finalize();
        let mut bytes: [u8; 16] = std::array::from_fn(|i| hash.as_bytes()[i]);
        bytes[6] = bytes[6] & 0x0f | 0x80; // version 8: of the writer's own making
        bytes[8] = bytes[8] & 0x3f | 0x80; // variant of RFC 9562
        let hex: String = bytes.iter().map(|byte| format!("{byte:02x}")).collect();
        [&hex[..8], &hex[8..12], &hex[12..16], &hex[16..20], &hex[20..]].join("-")
    }

    fn grid_metadata(&self, out: &mut Vec<u8>, grid: &VdbGrid) {
        let mut entries = vec![
            ("class", "string", b"fog volume".to_vec()),
            ("name", "string", grid.name.as_bytes().to_vec()),
            ("is_saved_as_half_float", "bool", vec![0]),
            ("file_voxel_count", "int64", (self.active_voxels() as i64).to_le_bytes().to_vec()),
        ];
        if let Some([least, greatest]) = self.bounds() {
            let corner = |c: [i32; 3]| c.iter().flat_map(|v| v.to_le_bytes()).collect();
            entries.push(("file_bbox_min", "vec3i", corner(least)));
            entries.push(("file_bbox_max", "vec3i", corner(greatest)));
        }
        entries.extend(grid.notes.iter().map(|(name, note)| (name.as_str(), "string", note.as_bytes().to_vec())));
        metadata(out, &entries);
    }

    /// Least and greatest active voxel.
    fn bounds(&self) -> Option<[[i32; 3]; 2]> {
        let mut bounds: Option<[[i32; 3]; 2]> = None;
        for leaf in &self.leaves {
            for index in (0..LEAF_VOXELS).filter(|index| leaf.mask[index / 64] >> (index % 64) & 1 == 1) {
                let inside = [index / 64, index / 8 % 8, index % 8];
                let voxel: [i32; 3] = std::array::from_fn(|axis| (leaf.at[axis] * 8) as i32 + inside[axis] as i32);
                let [least, greatest] = bounds.unwrap_or([voxel; 2]);
                bounds = Some([
                    std::array::from_fn(|axis| least[axis].min(voxel[axis])),
                    std::array::from_fn(|axis| greatest[axis].max(voxel[axis])),
                ]);
            }
        }
        bounds
    }

    fn topology(&self, out: &mut Vec<u8>) {
        number(out, 1); // buffers per leaf
        out.extend(0.0f32.to_le_bytes()); // background
        number(out, 0); // tiles of the root
        let uppers: Vec<&[Leaf]> = self.leaves.chunk_by(|a, b| upper(a.at) == upper(b.at)).collect();
        number(out, uppers.len() as u32);
        for leaves in uppers {
            upper(leaves[0].at).iter().for_each(|c| number(out, c * UPPER_NODES * NODE_LEAVES * 8)); // its first voxel
            let nodes: Vec<&[Leaf]> = leaves.chunk_by(|a, b| node(a.at) == node(b.at)).collect();
            inner_node::<512>(out, nodes.iter().map(|leaves| slot(node(leaves[0].at), UPPER_NODES)));
            for leaves in nodes {
                inner_node::<64>(out, leaves.iter().map(|leaf| slot(leaf.at, NODE_LEAVES)));
                leaves.iter().for_each(|leaf| words(out, &leaf.mask));
            }
        }
    }
}

fn upper(leaf: [u32; 3]) -> [u32; 3] {
    leaf.map(|c| c / (NODE_LEAVES * UPPER_NODES))
}

fn node(leaf: [u32; 3]) -> [u32; 3] {
    leaf.map(|c| c / NODE_LEAVES)
}

fn tree_order(leaf: [u32; 3]) -> [[u32; 3]; 3] {
    [upper(leaf), node(leaf), leaf]
}

/// Index of a child within its parent of `side`³ children.
fn slot(child: [u32; 3], side: u32) -> usize {
    let [x, y, z] = child.map(|c| (c % side) as usize);
    (x * side as usize + y) * side as usize + z
}

/// A node's masks (which children it has; which of its own values are active: none) and its own values: none are kept.
fn inner_node<const WORDS: usize>(out: &mut Vec<u8>, children: impl Iterator<Item = usize>) {
    let mut mask = [0u64; WORDS];
    children.for_each(|child| mask[child / 64] |= 1 << (child % 64));
    words(out, &mask);
    words(out, &[0; WORDS]);
    out.push(INACTIVE_ARE_BACKGROUND);
}

/// A uniform scale, then a translation: voxel centres to metres. The redundant numbers are OpenVDB's.
fn transform(out: &mut Vec<u8>, grid: &VdbGrid) {
    text(out, "UniformScaleTranslateMap");
    let s = grid.voxel;
    let centre = grid.corner.map(|c| c + 0.5 * s);
    for vector in [centre, [s; 3], [s; 3], [1.0 / s; 3], [1.0 / (s * s); 3], [0.5 / s; 3]] {
        vector.iter().for_each(|c| out.extend(c.to_le_bytes()));
    }
}

fn metadata(out: &mut Vec<u8>, entries: &[(&str, &str, Vec<u8>)]) {
    number(out, entries.len() as u32);
    for (name, kind, bytes) in entries {
        text(out, name);
        text(out, kind);
        number(out, bytes.len() as u32);
        out.extend(bytes);
    }
}

fn number(out: &mut Vec<u8>, value: u32) {
    out.extend(value.to_le_bytes());
}

fn text(out: &mut Vec<u8>, text: &str) {
    number(out, text.len() as u32);
    out.extend(text.as_bytes());
}

fn words(out: &mut Vec<u8>, words: &[u64]) {
    words.iter().for_each(|word| out.extend(word.to_le_bytes()));
}
