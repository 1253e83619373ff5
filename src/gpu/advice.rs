//! What to do on a system without Vulkan: one command, by distribution.

/// How to come by a Vulkan driver on this system, from what `/etc/os-release` says it is.
pub fn advice() -> String {
    advice_for(&std::fs::read_to_string("/etc/os-release").unwrap_or_default())
}

/// As [`advice`], for a system with this `os-release` (freedesktop.org's os-release(5)).
fn advice_for(os_release: &str) -> String {
    let value = |key: &str| {
        let mut lines = os_release.lines().filter_map(|line| line.strip_prefix(key)?.strip_prefix('='));
        lines.next().unwrap_or_default().trim_matches(['"', '\'']).to_owned()
    };
    // The distribution itself, then those that it derives from.
    let names = format!("{} {}", value("ID"), value("ID_LIKE"));
    let command = names.split_whitespace().find_map(|name| match name {
        "debian" | "ubuntu" => Some("sudo apt install mesa-vulkan-drivers"),
        "fedora" | "rhel" => Some("sudo dnf install mesa-vulkan-drivers"),
        "arch" => Some("sudo pacman -S vulkan-swrast"),
        _ => None,
    });
    let without_gpu = "works without a GPU too";
    match command {
        Some(command) => format!("install one with: {command} ({without_gpu})"),
        None => format!("install Mesa's Vulkan drivers from the packages of this system ({without_gpu})"),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn each_distribution_has_its_command() {
        let debian = "PRETTY_NAME=\"Debian GNU/Linux 12 (bookworm)\"\nVERSION_ID=\"12\"\nID=debian\n";
        let ubuntu = "NAME=\"Ubuntu\"\nID=ubuntu\nID_LIKE=debian\n";
        let mint = "ID=linuxmint\nID_LIKE=\"ubuntu debian\"\n";
        for text in [debian, ubuntu, mint] {
            assert!(advice_for(text).contains(": sudo apt install mesa-vulkan-drivers ("), "{}", advice_for(text));
        }
        assert!(advice_for("ID=fedora\nVERSION_ID=42\n").contains(": sudo dnf install mesa-vulkan-drivers ("));
        assert!(advice_for("ID='arch'\n").contains(": sudo pacman -S vulkan-swrast ("));
        for text in ["", "ID=plan9\n", "VERSION_ID=debian\n", "BUILD_ID=debian\n"] {
            assert!(advice_for(text).contains("from the packages of this system"), "{text:?}");
        }
    }
}
