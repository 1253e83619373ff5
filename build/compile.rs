//! GLSL 4.60 → SPIR-V 1.6 for Vulkan 1.3. One seam, two compilers: glslang by default, shaderc by feature.

use std::fs;
use std::path::Path;

/// The include that stands for the source function of each lighting method in turn.
const LIGHTING_SOURCE: &str = "lighting/source.glsl";

/// Source text and SPIR-V words of entry file `name`, for a lighting method if there is one for each; an error names file and
/// line.
pub fn compile(root: &Path, name: &str, lighting: Option<&str>) -> Result<(String, Vec<u32>), String> {
    let source = fs::read_to_string(root.join(name)).map_err(|error| format!("glsl/{name}: {error}"))?;
    let includes = Includes { root, lighting };
    let words = backend::compile(&includes, name, &source).map_err(|log| readable(name, &log))?;
    Ok((source, words))
}

/// Where includes lie.
struct Includes<'a> {
    root: &'a Path,
    lighting: Option<&'a str>,
}

impl Includes<'_> {
    /// Path and text of the include `header`.
    fn read(&self, header: &str) -> Result<(String, String), String> {
        let path = match self.lighting {
            Some(method) if header == LIGHTING_SOURCE => format!("lighting/{method}/source.glsl"),
            _ => header.to_owned(),
        };
        let text = fs::read_to_string(self.root.join(&path)).map_err(|error| format!("glsl/{path}: {error}"))?;
        Ok((path, text))
    }
}

/// Rewrites the compiler's `ERROR: 0:12:` and `ERROR: common/x.glsl:12:` to `glsl/<file>:12:`.
fn readable(name: &str, log: &str) -> String {
    let mut lines: Vec<String> = Vec::new();
    for line in log.lines() {
        let Some(rest) = line.strip_prefix("ERROR: ") else {
            if line.contains("error:") {
                lines.push(format!("glsl/{line}"));
            }
            continue;
        };
        let line = match rest.strip_prefix("0:") {
            Some(rest) => format!("glsl/{name}:{rest}"),
            None if rest.contains(".glsl:") => format!("glsl/{rest}"),
            None => format!("glsl/{name}: {rest}"),
        };
        if !lines.contains(&line) {
            lines.push(line);
        }
    }
    if lines.is_empty() { format!("glsl/{name}: {log}") } else { lines.join("\n") }
}

#[cfg(not(feature = "shaderc"))]
mod backend {
    use glslang::include::{IncludeHandler, IncludeResult, IncludeType};
    use glslang::{
        Compiler, CompilerOptions, ShaderInput, ShaderSource, ShaderStage, SourceLanguage, SpirvVersion, Target,
        VulkanVersion,
    };

    use super::Includes;

    struct Handler<'a>(&'a Includes<'a>);

    impl IncludeHandler for Handler<'_> {
        fn include(&mut self, _: IncludeType, header: &str, _: &str, _: usize) -> Option<IncludeResult> {
            self.0.read(header).ok().map(|(name, data)| IncludeResult { name, data })
        }
    }

    pub fn compile(includes: &Includes<'_>, name: &str, source: &str) -> Result<Vec<u32>, String> {
        let compiler = Compiler::acquire().ok_or("glslang could not be initialised")?;
        let stage = match name.rsplit('.').next() {
            Some("comp") => ShaderStage::Compute,
            Some("vert") => ShaderStage::Vertex,
            _ => ShaderStage::Fragment,
        };
        let options = CompilerOptions {
            source_language: SourceLanguage::GLSL,
            target: Target::Vulkan { version: VulkanVersion::Vulkan1_3, spirv_version: SpirvVersion::SPIRV1_6 },
            ..CompilerOptions::default()
        };
        let mut handler = Handler(includes);
        let source = ShaderSource::from(source);
        let input = ShaderInput::new(&source, stage, &options, None, Some(&mut handler)).map_err(|e| e.to_string())?;
        let shader = compiler.create_shader(input).map_err(|e| e.to_string())?;
        shader.compile().map_err(|e| e.to_string())
    }
}

#[cfg(feature = "shaderc")]
mod backend {
    use super::Includes;

    pub fn compile(includes: &Includes<'_>, name: &str, source: &str) -> Result<Vec<u32>, String> {
        let compiler = shaderc::Compiler::new().map_err(|error| error.to_string())?;
        let mut options = shaderc::CompileOptions::new().map_err(|error| error.to_string())?;
        options.set_target_env(shaderc::TargetEnv::Vulkan, shaderc::EnvVersion::Vulkan1_3 as u32);
        options.set_target_spirv(shaderc::SpirvVersion::V1_6);
        options.set_optimization_level(shaderc::OptimizationLevel::Performance);
        options.set_generate_debug_info(); // Keeps the names that reflection needs.
        options.set_include_callback(|header, _, _, _| {
            let (resolved_name, content) = includes.read(header)?;
            Ok(shaderc::ResolvedInclude { resolved_name, content })
        });
        let kind = match name.rsplit('.').next() {
            Some("comp") => shaderc::ShaderKind::Compute,
            Some("vert") => shaderc::ShaderKind::Vertex,
            _ => shaderc::ShaderKind::Fragment,
        };
        let artifact = compiler
            .compile_into_spirv(source, kind, name, "main", Some(&options))
            .map_err(|error| error.to_string())?;
        Ok(artifact.as_binary().to_vec())
    }
}
