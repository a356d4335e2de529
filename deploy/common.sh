# What the scripts beside it share. Sourced from the root of the tree, after
# `out`, the directory of the results, is set.

say() { printf '\n\033[1m%s\033[0m\n' "$*"; }

# Builds release binaries: of server and command line, or, after --tests, what is
# named.
build() {
  local tests=OFF packages=build targets=(deformd deformctl)
  if [ "${1:-}" = --tests ]; then
    tests=ON packages=test targets=("${@:2}")
  fi
  deploy/install $packages
  export CCACHE_BASEDIR="$PWD" CCACHE_NOHASHDIR=1
  mkdir -p "$out"
  cmake --preset release -DDEFORM_TESTS=$tests >"$out/configure.log" ||
    { cat "$out/configure.log"; exit 1; }
  cmake --build --preset release --target "${targets[@]}"
}
deformctl() { build/release/bin/deformctl "$@"; }

# Stops the server, and takes away what was half done.
server_pid=
stop_server() {
  [ -n "$server_pid" ] && kill "$server_pid" 2>/dev/null && wait "$server_pid" 2>/dev/null
  server_pid=
}
clean_up() {
  stop_server
  [ -n "${address_pipe:-}" ] && rm -f "$address_pipe"
  rm -f "$out"/vessel.stl.part "$out"/gmsh-doc_*.deb
  return 0
}
trap clean_up EXIT
trap 'echo; echo "stopped"; exit 130' INT TERM

# On a free port of this machine; deformctl finds it in DEFORM_SERVER. Keeps
# nothing, unless arguments say where.
start_server() {
  [ $# -gt 0 ] || set -- --in-memory
  # The pipe brings the line that tells the port.
  address_pipe=$(mktemp -u)
  mkfifo "$address_pipe"
  # In a session of its own: Ctrl-C is ours, the server is told to stop above.
  setsid build/release/bin/deformd --listen 127.0.0.1:0 "$@" --log-level warn >"$address_pipe" &
  server_pid=$!
  local address
  read -r _ _ address <"$address_pipe"
  rm -f "$address_pipe"
  export DEFORM_SERVER=$address
  echo "listening on $address"
}

# The first value of a name in JSON: json_value NAME <<<"$json"
json_value() { sed -n "/\"$1\":/{s/.*\"$1\": *\"\{0,1\}\([^\",}]*\).*/\1/p;q}"; }

# The aneurysm of Debian's gmsh-doc package, to $1.
fetch_vessel() {
  [ -s "$1" ] && return 0
  (
    cd "$(dirname "$1")"
    rm -f gmsh-doc_*.deb
    get() { apt-get -o APT::Sandbox::User=root download -qq gmsh-doc; }
    get || { apt-get update -qq && get; }
    # Slim images leave /usr/share/doc out when they install: unpack it here.
    dpkg-deb --fsys-tarfile gmsh-doc_*.deb |
      tar -xO --wildcards '*/aneurysm_data.stl.gz' | gunzip >vessel.stl.part
    mv vessel.stl.part "$(basename "$1")"
    rm -f gmsh-doc_*.deb
  )
}
