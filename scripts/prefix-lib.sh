# Sourced by the scripts that unpack packages of a distribution into a folder of their own, without root. They set:
#
#   name      of the script, for messages
#   target    the folder; it is replaced as a whole, and only when everything has been unpacked
#   suite     Debian's suite for use_recent
#
# and get `work`, a folder for the work that goes when the script ends, with `work/prefix/tree` for what is unpacked.
# Environment: LVP_MIRROR is the base URI of a Debian archive, LVP_KEYRING a file with its keys.
# shellcheck shell=sh disable=SC2154

die() { echo "$name: $*" >&2; exit 2; }

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
mkdir -p "$work/lists/partial" "$work/deb/partial" "$work/prefix/tree"
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

# What apt-get has left in work/deb: its libc's version, and whether the machine's is as new. A program needs the newer of
# the two; the machine's wins a tie, and then the unpacked one is dropped from work/prefix/tree.
machine_has_libc() {
    libc=$(basename "$(ls "$work"/deb/libc6_*.deb)") && libc=${libc#libc6_} && libc=${libc%%-*}
    dpkg --compare-versions "$(getconf GNU_LIBC_VERSION | cut -d' ' -f2)" ge "$libc" || return 1
    dpkg-deb -c "$work"/deb/libc6_*.deb | awk '$1 !~ /^d/ { print $6 }' | while read -r file; do rm -f "$work/prefix/tree/$file"; done
}

# Puts what has been unpacked in place.
finish() {
    (cd "$work/deb" && ls ./*.deb | sed 's#^./##') > "$work/prefix/packages.txt"
    echo "$stamp" > "$work/prefix/stamp"
    [ ! -e "$target" ] || mv "$target" "$work/old"
    mv "$work/prefix" "$target"
}
