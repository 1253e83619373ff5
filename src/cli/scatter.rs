//! `welkin scatter`: a field of cumulus as a list of particles.

use welkin::Result;
use welkin::output::write_particles;
use welkin::scatter::Field;

use super::args::ScatterArgs;
use super::places;
use super::progress::note;

pub fn run(args: &ScatterArgs) -> Result<()> {
    places::writable(&args.output)?;
    let &ScatterArgs { clouds, particles, seed, extent, base, radius, density, .. } = args;
    let list = Field { clouds, particles, seed, extent, base, radius, density }.particles()?;
    let how = format!(
        "welkin scatter --clouds {clouds} --particles {particles} --seed {seed} --extent {extent} --base {base} \
         --radius {radius} --density {density}"
    );
    write_particles(&args.output, &[how], &list)?;
    note(&format!("wrote {} ({particles} particles of {clouds} clouds)", args.output.display()));
    Ok(())
}
