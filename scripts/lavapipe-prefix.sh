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
[ $# -eq 2 ] || { echo "$usage" >&2; exit 2; }
origin=$1 target=$2
case $origin in recent | own) ;; *) echo "$usage" >&2; exit 2 ;; esac

suite=${LVP_SUITE:-trixie}
triple=x86_64-linux-gnu
packages="mesa-vulkan-drivers libvulkan1 vulkan-validationlayers"
name=lavapipe-prefix
stamp="$origin $suite $(cat "$0" "${0%/*}/prefix-lib.sh" | cksum)"
[ "$(cat "$target/stamp" 2>/dev/null || :)" != "$stamp" ] || exit 0
. "${0%/*}/prefix-lib.sh"

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

tree=$work/prefix/tree
for deb in "$work"/deb/*.deb; do # shared objects and layer manifests only; many packages hold neither
    dpkg-deb --fsys-tarfile "$deb" > "$work/tar" || die "damaged package: $(basename "$deb")"
    tar -xf "$work/tar" -C "$tree" --wildcards --no-wildcards-match-slash --no-anchored '*.so' '*.so.*' 'explicit_layer.d' \
        2>/dev/null || :
done
rm -f "$work/tar"

# Other GPUs' drivers and other layers go; what is left is what the prefix is for.
find "$tree" -name 'libvulkan_*.so' ! -name libvulkan_lvp.so -exec rm -f {} +
find "$tree" \( -name 'libVkLayer_MESA_*' -o -name 'libVkLayer_INTEL_*' -o -name 'VkLayer_[!k]*.json' \) -exec rm -f {} +

# With the prefix's libc, the prefix's loader starts the program; with the machine's, the library path is enough.
if machine_has_libc; then
    start='export WELKIN_LD_LIBRARY_PATH="${LD_LIBRARY_PATH-}" LD_LIBRARY_PATH="$libs"
exec "$@"'
else
    ld=$(cd "$tree" && find . -name ld-linux-x86-64.so.2 -path "*$triple*" | head -n1)
    [ -n "$ld" ] || die "the unpacked prefix holds no program loader"
    start="exec \"\$here/tree/${ld#./}\" --library-path \"\$libs\" --argv0 \"\$1\" \"\$@\""
fi
lvp=$(cd "$work/prefix" && find tree -name libvulkan_lvp.so | head -n1)
[ -n "$lvp" ] || die "the unpacked prefix holds no lavapipe"

# The path is relative to the manifest, so the prefix may be moved.
printf '{"file_format_version": "1.0.1", "ICD": {"library_path": "./%s", "api_version": "1.3.0"}}\n' "$lvp" \
    > "$work/prefix/lvp.json"
cat > "$work/prefix/run" <<RUN
#!/bin/sh
# Runs a program on this folder's Vulkan loader and lavapipe, or on the driver whose manifest WELKIN_ICD names:
# run PROGRAM ARGS...
here=\$(cd "\${0%/*}" && pwd)
case \$1 in */*) ;; *) program=\$(command -v "\$1") && { shift; set -- "\$program" "\$@"; } ;; esac
libs=\$here/tree/usr/lib/$triple:\$here/tree/lib/$triple:/usr/lib/$triple:/lib/$triple\${LD_LIBRARY_PATH:+:\$LD_LIBRARY_PATH}
icd=\${WELKIN_ICD:-\$here/lvp.json}
export WELKIN_PREFIX="\$here" VK_DRIVER_FILES="\$icd" VK_ICD_FILENAMES="\$icd"
export VK_LAYER_PATH="\$here/tree/usr/share/vulkan/explicit_layer.d" VK_LOADER_LAYERS_DISABLE='~implicit~'
$start
RUN
chmod +x "$work/prefix/run"
finish
echo "lavapipe-prefix: $(grep mesa-vulkan "$target/packages.txt" | cut -d_ -f2), $(du -sh "$target" | cut -f1)" >&2
