//! Tables for other programs: `.npy` files and a `tables.json` that names their axes.

use std::path::Path;

use serde::Serialize;

use super::{npy, write_json};
use crate::{Error, Result};

/// One axis of a table.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Axis {
    /// What the axis is, for example `cos_theta`.
    pub name: String,
    /// What that means, in a sentence.
    pub meaning: String,
    /// Unit of the values; `1` for a pure number.
    pub unit: String,
    /// The value at each index.
    pub values: AxisValues,
}

/// The values of an axis.
#[derive(Clone, Debug, PartialEq, Serialize)]
#[serde(untagged)]
pub enum AxisValues {
    /// The same wherever one stands: a plain list in JSON.
    Fixed(Vec<f64>),
    /// Other ones at each index of another axis: `{"per": "optical_radius", "values": [[…], …]}` in JSON.
    Per {
        /// Name of the other axis.
        per: String,
        /// A list for each of its indices, all of one length.
        values: Vec<Vec<f64>>,
    },
}

impl AxisValues {
    /// Number of indices of the axis.
    fn count(&self) -> usize {
        match self {
            Self::Fixed(values) => values.len(),
            Self::Per { values, .. } => values.first().map_or(0, Vec::len),
        }
    }
}

/// An n-dimensional table.
#[derive(Clone, Debug, PartialEq)]
pub struct Table {
    /// Name, also of the file: `single_scattering` becomes `single_scattering.npy`.
    pub name: String,
    /// What the values are.
    pub quantity: String,
    /// Unit of the values; `1` for a pure number.
    pub unit: String,
    /// The axes, slowest first.
    pub axes: Vec<Axis>,
    /// Several values at each point, for example `["mean_density", "first_matter"]`; they make one more axis, the fastest.
    /// Empty for one value.
    pub components: Vec<String>,
    /// The values in C order: the last axis fastest.
    pub values: Vec<f32>,
}

/// A table as `tables.json` describes it.
#[derive(Serialize)]
struct Entry<'a> {
    name: &'a str,
    file: String,
    quantity: &'a str,
    unit: &'a str,
    shape: Vec<u64>,
    axes: &'a [Axis],
    components: &'a [String],
}

impl Table {
    fn shape(&self) -> Vec<u64> {
        let components = (!self.components.is_empty()).then_some(self.components.len() as u64);
        self.axes.iter().map(|axis| axis.values.count() as u64).chain(components).collect()
    }
}

/// Writes each table as `NAME.npy` into `directory`, which is created if need be, then `tables.json`:
/// `{parameters, tables: [{name, file, quantity, unit, shape, axes: [{name, meaning, unit, values}], components}]}`.
///
/// # Errors
/// [`Error::File`] when a value is not finite or a file cannot be written.
pub fn write_tables(directory: &Path, parameters: &impl Serialize, tables: &[Table]) -> Result<()> {
    #[derive(Serialize)]
    struct Index<'a, P> {
        parameters: &'a P,
        tables: Vec<Entry<'a>>,
    }
    std::fs::create_dir_all(directory).map_err(|error| Error::file(directory, format!("cannot be made: {error}")))?;
    let mut entries = Vec::with_capacity(tables.len());
    for table in tables {
        let (file, shape) = (format!("{}.npy", table.name), table.shape());
        let path = directory.join(&file);
        assert_eq!(
            shape.iter().product::<u64>(),
            table.values.len() as u64,
            "table {} has one value a point",
            table.name
        );
        if let Some(index) = table.values.iter().position(|v| !v.is_finite()) {
            return Err(Error::file(&path, format!("not written: value {index} is {}", table.values[index])));
        }
        npy::write(&path, &shape, table.values.iter().copied())?;
        let Table { name, quantity, unit, axes, components, .. } = table;
        entries.push(Entry { name, file, quantity, unit, shape, axes, components });
    }
    write_json(&directory.join("tables.json"), &Index { parameters, tables: entries })
}

#[cfg(test)]
mod tests {
    use super::*;

    fn table() -> Table {
        let axis = |name: &str, values| Axis { name: name.into(), meaning: "m".into(), unit: "1".into(), values };
        let per_u = AxisValues::Per { per: "u".into(), values: vec![vec![0.0, 0.5, 1.0], vec![0.0, 0.1, 1.0]] };
        Table {
            name: "depth".into(),
            quantity: "mean density".into(),
            unit: "1".into(),
            axes: vec![axis("u", AxisValues::Fixed(vec![0.0, 1.0])), axis("v", per_u)],
            components: vec!["mean".into(), "first".into()],
            values: (0..12).map(|i| i as f32).collect(),
        }
    }

    #[test]
    fn tables_come_back_with_their_axes() {
        let directory = tempfile::tempdir().unwrap();
        let out = directory.path().join("new/tables");
        write_tables(&out, &serde_json::json!({"g": 0.9}), &[table()]).unwrap();
        let bytes = std::fs::read(out.join("depth.npy")).unwrap();
        let file = npyz::NpyFile::new(&bytes[..]).unwrap();
        assert_eq!((file.shape(), file.order()), (&[2, 3, 2][..], npyz::Order::C));
        assert_eq!(file.into_vec::<f32>().unwrap(), table().values);
        let index: serde_json::Value =
            serde_json::from_slice(&std::fs::read(out.join("tables.json")).unwrap()).unwrap();
        assert_eq!(index["parameters"]["g"], 0.9);
        assert_eq!(index["tables"][0]["file"], "depth.npy");
        assert_eq!(index["tables"][0]["shape"], serde_json::json!([2, 3, 2]));
        assert_eq!(index["tables"][0]["axes"][0]["values"], serde_json::json!([0.0, 1.0]));
        let per_u = serde_json::json!({"per": "u", "values": [[0.0, 0.5, 1.0], [0.0, 0.1, 1.0]]});
        assert_eq!(index["tables"][0]["axes"][1]["values"], per_u);
    }

    #[test]
    fn a_table_with_a_bad_value_is_refused() {
        let directory = tempfile::tempdir().unwrap();
        let mut bad = table();
        bad.values[5] = f32::NAN;
        let message = write_tables(directory.path(), &(), &[bad]).unwrap_err().to_string();
        assert!(message.ends_with("depth.npy: not written: value 5 is NaN"), "{message}");
        assert_eq!(std::fs::read_dir(directory.path()).unwrap().count(), 0);
    }
}
