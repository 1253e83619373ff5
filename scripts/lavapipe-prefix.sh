#!/bin/sh
# Unpacks lavapipe (Mesa's Vulkan driver for the CPU), the Vulkan loader and the validation layer with every library
# that they need into a folder of their own, without root:
#
#   lavapipe-prefix.sh recent DIR   Debian's newest build, which offers VK_EXT_fragment_shader_interlock
#   lavapipe-prefix.sh own DIR      the build of the distribution that this machine runs
#
# Afterwards `DIR/run PROGRAM ARGS...` runs a program on that driver. Nothing outside DIR is touched, and DIR may be
# moved. A second call finds DIR complete and does nothing; a call that is cut off leaves nothing behind.
#
# Packages come from the archive that apt is set up for on this machine; apt checks each against the archive's keys.
# What can be named by hand for `recent`:
#   LVP_MIRROR   base URI of a Debian archive       LVP_SUITE   Debian's suite (trixie)
#   LVP_KEYRING  file with the archive's keys
set -eu
umask 022

usage="usage: lavapipe-prefix.sh recent|own DIR"
die() { echo "lavapipe-prefix: $*" >&2; exit 2; }
[ $# -eq 2 ] || die "$usage"
origin=$1 target=$2
case $origin in recent | own) ;; *) die "$usage" ;; esac

suite=${LVP_SUITE:-trixie}
triple=x86_64-linux-gnu
packages="mesa-vulkan-drivers libvulkan1 vulkan-validationlayers"
stamp="$origin $suite $(cksum < "$0")"
[ "$(cat "$target/stamp" 2>/dev/null || :)" != "$stamp" ] || exit 0

for tool in apt-get apt-cache dpkg dpkg-deb tar; do
    command -v $tool >/dev/null || die "needs $tool; on a system without apt, install a Vulkan driver from its own packages"
done
[ "$(dpkg --print-architecture)" = amd64 ] || die "only amd64 is handled, this machine is $(dpkg --print-architecture)"

# The machine's distribution; a derivative of Ubuntu names the release that it takes its packages from.
os() { (. /etc/os-release; eval "echo \"\${$1-}\""); }
if [ -n "$(os UBUNTU_CODENAME)" ]; then distribution=ubuntu codename=$(os UBUNTU_CODENAME); else
    distribution=$(os ID) codename=$(os VERSION_CODENAME)
fi

mkdir -p "$(dirname "$target")"
parent=$(cd "$(dirname "$target")" && pwd)
target=$parent/$(basename "$target")
work=$(mktemp -d "$parent/.unpack.XXXXXX")
trap 'rm -rf "$work"' EXIT
trap 'exit 130' INT TERM HUP
mkdir -p "$work/lists/partial" "$work/deb/partial" "$work/prefix/root"
: > "$work/status"

# apt with private state: the machine's lists, package status and trust store are neither read nor written.
apt_() {
    tool=$1; shift
    LC_ALL=C "$tool" -qq -o Dir::State="$work" -o Dir::State::lists="$work/lists" -o Dir::State::status="$work/status" \
        -o Dir::Cache="$work" -o Dir::Cache::archives="$work/deb" -o Dir::Etc::sourcelist="$work/sources.list" \
        -o Dir::Etc::sourceparts=/dev/null -o Dir::Etc::preferences=/dev/null -o Dir::Etc::preferencesparts=/dev/null \
        -o APT::Architecture=amd64 -o APT::Architectures=amd64 -o APT::Sandbox::User= -o Debug::NoLocking=1 \
        -o APT::Install-Recommends=0 -o Acquire::Languages=none -o Acquire::Retries=3 -o APT::Update::Error-Mode=any \
        "$@" 2>"$work/errors"
}

# What apt is set up for, one "URI SUITE COMPONENT" a line. A cloud image names a file of mirrors: its first line counts.
configured() {
    # shellcheck disable=SC2016 # apt expands these, not the shell
    apt-get indextargets --format '$(REPO_URI) $(RELEASE) $(COMPONENT)' 'Created-By: Packages' |
        while read -r uri release component; do
            case $uri in mirror+file:*) f=${uri#mirror+file:}; uri=$(grep -m1 '^[^#]' "${f%/}" || :) ;; esac
            echo "${uri%/} $release $component"
        done
}

use_own() {
    keys=/usr/share/keyrings/$distribution-archive-keyring.gpg
    if [ -r "$keys" ]; then option="[signed-by=$keys] "; else option=; fi
    configured | while read -r uri release component; do
        case $release in "$codename" | "$codename"-*) echo "deb $option$uri $release $component" ;; esac
    done > "$work/sources.list"
    [ -s "$work/sources.list" ] || die "apt is not set up for this distribution's own archive ($distribution $codename)"
    apt_ apt-get update
}

use_debian() { # SUITE...
    for s; do echo "deb [signed-by=$keyring] $mirror $s main"; done > "$work/sources.list"
    apt_ apt-get update
}

unpacked() { # PACKAGE: downloads a package of the archive in use and prints where it lies unpacked
    rm -rf "${work:?}/$1" && mkdir -p "$work/$1"
    (cd "$work/$1" && apt_ apt-get download "$1" && dpkg-deb -x ./*.deb .) || return 1
    echo "$work/$1"
}

keys_in() { find "$1" -name 'debian-archive-keyring.[gp]*' 2>/dev/null | head -n1; }

# Debian's archive: named by hand, or the one that apt uses, or (elsewhere) the default of the distribution's debootstrap.
find_mirror() {
    mirror=${LVP_MIRROR:-$(configured | cut -d' ' -f1 | grep -m1 '/debian$' || :)}
    [ -z "$mirror" ] || return 0
    if use_own && boot=$(unpacked debootstrap); then
        mirror=$(sed -n 's/^DEF_MIRROR="\(.*\)"$/\1/p' "$boot/usr/sbin/debootstrap" | head -n1)
    fi
    [ -n "$mirror" ] || die "no Debian archive is known here: set LVP_MIRROR (and LVP_KEYRING)"
}

# An old keyring does not know a new suite. A suite that it does know has a newer keyring, so step up through those.
use_recent() {
    find_mirror
    keyring=${LVP_KEYRING:-$(keys_in /usr/share/keyrings)}
    [ -z "$keyring" ] || ! use_debian "$suite" "$suite-backports" || return 0
    [ -z "${LVP_KEYRING-}" ] || return 1
    if use_own && ring=$(unpacked debian-archive-keyring); then
        keyring=$(keys_in "$ring")
        ! use_debian "$suite" "$suite-backports" || return 0
    fi
    for step in bullseye bookworm; do
        [ -n "$keyring" ] && use_debian $step && ring=$(unpacked debian-archive-keyring) || continue
        cp "$(keys_in "$ring")" "$work/$step.gpg" && keyring=$work/$step.gpg
        ! use_debian "$suite" "$suite-backports" || return 0
    done
    return 1
}

echo "lavapipe-prefix: unpacking lavapipe ($origin) into $target" >&2
if [ "$origin" = recent ]; then
    use_recent || { cat "$work/errors" >&2; die "cannot read Debian's $suite: the archive is out of reach or its key unknown"; }
    set -- -t "$suite-backports"
else
    use_own || { cat "$work/errors" >&2; die "cannot read this distribution's package archive"; }
    set --
fi
# shellcheck disable=SC2086 # a list
apt_ apt-get install -y --download-only "$@" $packages >/dev/null || { cat "$work/errors" >&2; die "download failed"; }

root=$work/prefix/root
for deb in "$work"/deb/*.deb; do # shared objects and layer manifests only; many packages hold neither
    dpkg-deb --fsys-tarfile "$deb" > "$work/tar" || die "damaged package: $(basename "$deb")"
    tar -xf "$work/tar" -C "$root" --wildcards --no-wildcards-match-slash --no-anchored '*.so' '*.so.*' 'explicit_layer.d' \
        2>/dev/null || :
done
rm -f "$work/tar"

# Other GPUs' drivers and other layers go; what is left is what the prefix is for.
find "$root" -name 'libvulkan_*.so' ! -name libvulkan_lvp.so -exec rm -f {} +
find "$root" \( -name 'libVkLayer_MESA_*' -o -name 'libVkLayer_INTEL_*' -o -name 'VkLayer_[!k]*.json' \) -exec rm -f {} +

# A program needs the newer libc of the two: the prefix's, then the prefix's loader starts the program; or the machine's,
# then the prefix's is dropped and the library path is enough.
libc=$(basename "$(ls "$work"/deb/libc6_*.deb)") && libc=${libc#libc6_} && libc=${libc%%-*}
if dpkg --compare-versions "$(getconf GNU_LIBC_VERSION | cut -d' ' -f2)" ge "$libc"; then
    dpkg-deb -c "$work"/deb/libc6_*.deb | awk '$1 !~ /^d/ { print $6 }' | while read -r file; do rm -f "$root/$file"; done
    start='export WELKIN_LD_LIBRARY_PATH="${LD_LIBRARY_PATH-}" LD_LIBRARY_PATH="$libs"
exec "$@"'
else
    ld=$(cd "$root" && find . -name ld-linux-x86-64.so.2 -path "*$triple*" | head -n1)
    [ -n "$ld" ] || die "the unpacked prefix holds no program loader"
    start="exec \"\$here/root/${ld#./}\" --library-path \"\$libs\" --argv0 \"\$1\" \"\$@\""
fi
lvp=$(cd "$work/prefix" && find root -name libvulkan_lvp.so | head -n1)
[ -n "$lvp" ] || die "the unpacked prefix holds no lavapipe"

# The path is relative to the manifest, so the prefix may be moved.
printf '{"file_format_version": "1.0.1", "ICD": {"library_path": "./%s", "api_version": "1.3.0"}}\n' "$lvp" \
    > "$work/prefix/lvp.json"
cat > "$work/prefix/run" <<RUN
#!/bin/sh
# Runs a program on this folder's Vulkan loader and lavapipe: run PROGRAM ARGS...
here=\$(cd "\${0%/*}" && pwd)
case \$1 in */*) ;; *) program=\$(command -v "\$1") && { shift; set -- "\$program" "\$@"; } ;; esac
libs=\$here/root/usr/lib/$triple:\$here/root/lib/$triple:/usr/lib/$triple:/lib/$triple\${LD_LIBRARY_PATH:+:\$LD_LIBRARY_PATH}
export WELKIN_PREFIX="\$here" VK_DRIVER_FILES="\$here/lvp.json" VK_ICD_FILENAMES="\$here/lvp.json"
export VK_LAYER_PATH="\$here/root/usr/share/vulkan/explicit_layer.d" VK_LOADER_LAYERS_DISABLE='~implicit~'
$start
RUN
chmod +x "$work/prefix/run"
(cd "$work/deb" && ls ./*.deb | sed 's#^./##') > "$work/prefix/packages.txt"
echo "$stamp" > "$work/prefix/stamp"

[ ! -e "$target" ] || mv "$target" "$work/old"
mv "$work/prefix" "$target"
echo "lavapipe-prefix: $(grep mesa-vulkan "$target/packages.txt" | cut -d_ -f2), $(du -sh "$target" | cut -f1)" >&2
