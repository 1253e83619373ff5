#!/bin/sh
# Unpacks Chromium's headless shell with every library and font that it needs into a folder of its own, without root:
#
#   chromium-prefix.sh DIR
#
# Afterwards `DIR/run ARGS...` starts the browser, for the test that clicks through a report of `welkin ab`, and
# `DIR/swiftshader.json` is the manifest of SwiftShader, a second Vulkan driver for the CPU, which Chromium brings along.
# 118 MB to fetch, 320 MB on disk. Nothing outside DIR is touched, and DIR may be moved. A second call finds DIR complete
# and does nothing; a call that is cut off leaves nothing behind.
#
# The packages are Debian's: of the release that this machine runs, or elsewhere (Ubuntu's Chromium is a snap) of Debian 12,
# from the archive that lavapipe-prefix.sh finds too. The browser starts processes of its own, so it runs on the machine's
# libc, which must be as new as the packages'.
set -eu
umask 022

[ $# -eq 1 ] || { echo "usage: chromium-prefix.sh DIR" >&2; exit 2; }
target=$1
suite=bookworm
name=chromium-prefix
stamp=$(cat "$0" "${0%/*}/prefix-lib.sh" | cksum)
[ "$(cat "$target/stamp" 2>/dev/null || :)" != "$stamp" ] || exit 0
. "${0%/*}/prefix-lib.sh"

echo "chromium-prefix: unpacking Chromium's headless shell into $target" >&2
if [ "$distribution" = debian ]; then
    use_own || { cat "$work/errors" >&2; die "cannot read this distribution's package archive"; }
else
    use_recent || { cat "$work/errors" >&2; die "cannot read Debian's $suite: the archive is out of reach or its key unknown"; }
fi
# A headless browser has no use for these, which would bring along Mesa, LLVM and a desktop's tools.
for package in x11-utils xdg-utils xkb-data shared-mime-info mesa-libgallium; do
    printf 'Package: %s\nStatus: install ok installed\nVersion: 99:0\nArchitecture: amd64\nMaintainer: none\nDescription: left out\n\n' $package
done > "$work/status"
apt_ apt-get install -y --download-only chromium-headless-shell >/dev/null || { cat "$work/errors" >&2; die "download failed"; }

tree=$work/prefix/tree
for deb in "$work"/deb/*.deb; do
    dpkg-deb --fsys-tarfile "$deb" > "$work/tar" || die "damaged package: $(basename "$deb")"
    tar -xf "$work/tar" -C "$tree" --wildcards --no-wildcards-match-slash --no-anchored '*.so' '*.so.*' chromium truetype \
        2>/dev/null || :
done
rm -f "$work/tar"
browser=usr/lib/chromium
[ -x "$tree/$browser/chromium-headless-shell" ] || die "the unpacked prefix holds no browser"
rm -rf "$tree/$browser"/libVk* "$tree/$browser"/chrome_crashpad_handler "$tree/$browser"/*.TOC "$tree/usr/share/doc"
machine_has_libc || die "Chromium's libraries need libc $libc, and this machine's is older"

if [ -f "$tree/$browser/libvk_swiftshader.so" ]; then # the path is relative to the manifest
    printf '{"file_format_version": "1.0.1", "ICD": {"library_path": "./tree/%s/libvk_swiftshader.so", "api_version": "1.3.0"}}\n' \
        "$browser" > "$work/prefix/swiftshader.json"
fi
cat > "$work/prefix/fonts.conf" <<'CONF'
<?xml version="1.0"?>
<!DOCTYPE fontconfig SYSTEM "urn:fontconfig:fonts.dtd">
<fontconfig>
  <dir prefix="relative">tree/usr/share/fonts</dir>
  <cachedir prefix="xdg">fontconfig</cachedir>
</fontconfig>
CONF
cat > "$work/prefix/run" <<'RUN'
#!/bin/sh
# Starts this folder's headless Chromium: run ARGS...
here=$(cd "${0%/*}" && pwd)
# Only the packages' libraries: a driver's prefix that the caller runs on may have its own libc.
unset WELKIN_PREFIX WELKIN_LD_LIBRARY_PATH VK_DRIVER_FILES VK_ICD_FILENAMES VK_LAYER_PATH VK_LOADER_LAYERS_DISABLE
libs=$here/tree/usr/lib/x86_64-linux-gnu
export LD_LIBRARY_PATH="$libs:$libs/pulseaudio:$here/tree/lib/x86_64-linux-gnu" FONTCONFIG_FILE="$here/fonts.conf"
exec "$here/tree/usr/lib/chromium/chromium-headless-shell" "$@"
RUN
chmod +x "$work/prefix/run"
# It must start here: a missing library shows now.
"$work/prefix/run" --version >/dev/null 2>"$work/errors" || { cat "$work/errors" >&2; die "the unpacked browser does not start"; }
finish
echo "chromium-prefix: $(grep chromium-headless "$target/packages.txt" | cut -d_ -f2), $(du -sh "$target" | cut -f1)" >&2
