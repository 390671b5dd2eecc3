#!/bin/sh
# One drive from a shell; `drive.sh --help` says how. The answer goes to standard output as the service sent it; a
# refusal or failure goes to standard error in one line, with a non-zero exit.
set -eu

usage() {
    cat <<'EOF'
usage: drive.sh [--csv] MASS_KG TORQUE_NM HORIZON_S DISTANCE_M:SLOPE_DEG...

Asks a rover-twin service where the rover goes along a track. Mass in kg, motor stall torque per wheel in N m,
horizon in seconds. The slope (degrees, positive uphill) is linear between the knots and constant beyond them;
the distance (m) is along the surface, 0 where the rover starts.

  --csv     a table with a row for each time, instead of JSON
  --help    this text

ROVER_TWIN_URL is the service's address, http://127.0.0.1:8000 when not set. ROVER_TWIN_TOKEN is a token, for a
service that wants one.
Exits: 0 answered, 1 refused or failed (the reason on standard error), 2 wrong usage.

  drive.sh 430 100 20 0:10 2:10 2.3:20
  drive.sh --csv 430 100 20 0:5 > drive.csv
EOF
}

complain() { # MESSAGE EXIT
    printf 'drive.sh: %s\n' "$1" >&2
    exit "$2"
}

reason() { # FILE: the problem's "detail" on one line, or the first line of another answer
    found=$(tr -d '\r\n' <"$1" | sed -n 's/.*"detail" *: *"\(\([^"\\]\|\\.\)*\)".*/\1/p' | sed 's/\\\(["\\/]\)/\1/g')
    if [ -n "$found" ]; then printf '%s' "$found"; else head -c 200 "$1" | head -n 1; fi
}

require_number() { # TEXT NAME: only what JSON takes for a number may enter the body
    case $1 in *[!0-9.eE+-]*) complain "$2 is '$1', which is no number" 2 ;; esac # more than one line, for grep
    printf '%s' "$1" | grep -Eq '^-?(0|[1-9][0-9]*)(\.[0-9]+)?([eE][+-]?[0-9]+)?$' ||
        complain "$2 is '$1', which is no number" 2
}

format=json
case ${1:-} in
--csv)
    format=csv
    shift
    ;;
-h | --help)
    usage
    exit 0
    ;;
--*) complain "unknown option $1; see drive.sh --help" 2 ;;
esac
if [ $# -lt 4 ]; then
    usage >&2
    exit 2
fi
command -v curl >/dev/null || complain "curl is not installed" 1
require_number "$1" MASS_KG
require_number "$2" TORQUE_NM
require_number "$3" HORIZON_S
said="\"mass_kg\": $1, \"controls\": $2, \"horizon_s\": $3"
shift 3
distances='' slopes=''
for knot; do
    case $knot in
    *:*) ;;
    *) complain "'$knot' is no knot; write DISTANCE_M:SLOPE_DEG, such as 2.3:20" 2 ;;
    esac
    require_number "${knot%%:*}" DISTANCE_M
    require_number "${knot#*:}" SLOPE_DEG
    distances="$distances${distances:+, }${knot%%:*}"
    slopes="$slopes${slopes:+, }${knot#*:}"
done

answer=$(mktemp)
token=$(mktemp) # a file that others cannot read, for they can read the arguments of a command
trap 'rm -f "$answer" "$token"' EXIT
trap 'exit 130' INT
trap 'exit 143' TERM
url=${ROVER_TWIN_URL:-http://127.0.0.1:8000}
[ -z "${ROVER_TWIN_TOKEN:-}" ] || printf '%s' "$ROVER_TWIN_TOKEN" | tr -d '\r\n' | sed 's/[\\"]/\\&/g' |
    sed 's/.*/header = "Authorization: Bearer &"/' >"$token"
status=$(printf '{%s, "track": {"distance_m": [%s], "slope_deg": [%s]}}' "$said" "$distances" "$slopes" |
    curl --config "$token" --silent --show-error --connect-timeout 3 --max-time 60 --output "$answer" --write-out '%{http_code}' \
        --header 'Content-Type: application/json' --data-binary @- "${url%/}/v1/drives?format=$format") || exit 1

[ "$status" = 200 ] || complain "$(reason "$answer") (HTTP $status)" 1
cat "$answer"
