# Functions for bare Debian roots, to be sourced by the other scripts.
#
# A root is made by debootstrap, reaches its mirror and registries as this machine does, and runs commands in a mount
# namespace of its own. Downloads are shared between roots: $DOWNLOADS has apt's archives, and the caches of pip and uv.

PACKAGES=python3,python3-venv,git,ca-certificates

# The reason why no root can be made on this machine; nothing where one can.
why_no_root() {
  if [ "$(id -u)" != 0 ]; then
    echo "only the root user can make one"
  elif ! command -v apt-get >/dev/null; then
    echo "this machine has no apt-get"
  elif ! unshare --mount --propagation private true 2>/dev/null; then
    echo "this machine gives no mount namespace"
  elif ! command -v debootstrap >/dev/null && ! install_debootstrap; then
    echo "apt-get cannot install debootstrap"
  fi
}

install_debootstrap() {
  { apt-get -qq update && apt-get -qq install -y debootstrap; } >/dev/null 2>&1
}

# The mirror of Debian that this machine uses, else the public one.
mirror() {
  local uris
  uris=$({
    grep -rhs '^deb ' /etc/apt/sources.list /etc/apt/sources.list.d/*.list || true
    grep -hs '^URIs:' /etc/apt/sources.list.d/*.sources || true
  } | grep -oE 'https?://[^ ]+/debian/?( |$)' || true)
  echo "${uris:-http://deb.debian.org/debian}" | head -n 1 | tr -d ' '
}

# make_root SUITE ROOT: a bare Debian of that suite; on failure says why and returns 1. Roots of one name share
# apt's archives, so two of one name must not be made at once.
make_root() {
  local suite=$1 root=$2 archives="$DOWNLOADS/apt-${2##*/}" script=/usr/share/debootstrap/scripts
  mkdir -p "$archives"
  # A debootstrap that is older than the suite knows it by the script that all suites share.
  [ -e "$script/$suite" ] || script=$script/sid
  [ "${script##*/}" = sid ] || script=
  if ! debootstrap --cache-dir="$(realpath "$archives")" --variant=minbase --include="$PACKAGES" \
    "$suite" "$root" "$(mirror)" ${script:+"$script"} >"$root.log" 2>&1; then
    echo "debootstrap failed ($(tail -n 1 "$root.log"))"
    return 1
  fi
  rm -f "$root.log"
}

# configure_root ROOT: lets a root reach what this machine reaches, as far as the usual places say how.
configure_root() {
  local root=$1 name
  for name in ssl/. resolv.conf hosts pip.conf uv/.; do
    [ -e "/etc/$name" ] || continue
    [ "${name%/.}" = "$name" ] || mkdir -p "$root/etc/${name%/.}"
    cp -aLf "/etc/$name" "$root/etc/${name%/.}" 2>/dev/null || cp -af "/etc/$name" "$root/etc/${name%/.}"
  done
  mkdir -p "$root/downloads" "$root/home/new"
}

# in_root ROOT FOLDER COMMAND: a command in a folder of a root, as a user with an empty HOME and no settings but
# those of the network. Its mounts end with it.
in_root() {
  local root=$1 folder=$2 command=$3 variables
  local network='^(PIP|UV)_[A-Z_]+=|^(https?|no|all)_proxy=|^SSL_CERT_|_CA_BUNDLE=|^GIT_SSL_CAINFO='
  local useless='^(PIP|UV)_(CACHE_DIR=|FIND_LINKS=(/|file:))'  # folders that no root has
  mapfile -t variables < <(env | grep -iE "$network" | grep -vE "$useless" || true)
  unshare --mount --propagation private bash -euc '
    root=$1 downloads=$2
    shift 2
    mount -t proc proc "$root/proc"
    mount --rbind /dev "$root/dev"
    mount -t tmpfs tmpfs "$root/dev/shm"
    mount --bind "$downloads" "$root/downloads"
    exec chroot "$root" "$@"' - "$root" "$DOWNLOADS" \
    /usr/bin/env -i "${variables[@]}" PATH=/usr/sbin:/usr/bin:/sbin:/bin LANG=C.UTF-8 HOME=/home/new \
    PIP_CACHE_DIR=/downloads/pip UV_CACHE_DIR=/downloads/uv \
    bash -euo pipefail -c "cd $folder; $command"
}

# timed LABEL COMMAND...: says what it does, does it, and says how long it took.
timed() {
  local label=$1 began=$SECONDS
  shift
  echo "+ $label"
  "$@"
  echo "  $label: $((SECONDS - began)) s"
}
