#!/bin/sh
# Steps one rover from a shell; `steps.sh --help` says how. The state travels with each request: any replica answers.
set -eu

usage() {
    cat <<'EOF'
usage: steps.sh MASS_KG < STEPS

Reads lines `SLOPE_DEG TORQUE_NM DT_S` from standard input (`brake` instead of a torque locks the wheels), moves
one rover of this mass step by step, and writes a line for each: time_s x_m speed_m_s.

ROVER_TWIN_URL is the service's address, http://127.0.0.1:8000 when not set. ROVER_TWIN_TOKEN is a token, for a
service that wants one.
Exits: 0 done, 1 refused or failed (the reason on standard error), 2 wrong usage.

  printf '10 100 0.5\n15 100 0.5\n15 brake 0.5\n' | steps.sh 430
EOF
}

complain() { # MESSAGE EXIT
    printf 'steps.sh: %s\n' "$1" >&2
    exit "$2"
}

member() { # NAME: the first value of that name in the answer, without quotes
    tr -d '\r\n' <"$answer" | sed -n "s/.*\"$1\" *: *\"\{0,1\}\([^\",}]*\).*/\1/p"
}

reason() { # what went wrong with the rover, or the first line of another answer
    found=$(tr -d '\r\n' <"$answer" | sed -n 's/.*"detail" *: *"\(\([^"\\]\|\\.\)*\)".*/\1/p' | sed 's/\\\(["\\/]\)/\1/g')
    if [ -n "$found" ]; then printf '%s' "$found"; else head -c 200 "$answer" | head -n 1; fi
}

require_number() { # TEXT NAME: only what JSON takes for a number may enter the body
    case $1 in *[!0-9.eE+-]*) complain "$2 is '$1', which is no number" 2 ;; esac # more than one line, for grep
    printf '%s' "$1" | grep -Eq '^-?(0|[1-9][0-9]*)(\.[0-9]+)?([eE][+-]?[0-9]+)?$' ||
        complain "$2 is '$1', which is no number" 2
}

case ${1:-} in
-h | --help)
    usage
    exit 0
    ;;
esac
if [ $# -ne 1 ]; then
    usage >&2
    exit 2
fi
command -v curl >/dev/null || complain "curl is not installed" 1
require_number "$1" MASS_KG

answer=$(mktemp)
token=$(mktemp) # a file that others cannot read, for they can read the arguments of a command
trap 'rm -f "$answer" "$token"' EXIT
trap 'exit 130' INT
trap 'exit 143' TERM
url=${ROVER_TWIN_URL:-http://127.0.0.1:8000}
[ -z "${ROVER_TWIN_TOKEN:-}" ] || printf '%s' "$ROVER_TWIN_TOKEN" | tr -d '\r\n' | sed 's/[\\"]/\\&/g' |
    sed 's/.*/header = "Authorization: Bearer &"/' >"$token"
origin="\"start\": {\"mass_kg\": $1}"
ending=$(printf '\r')
while read -r slope torque dt || [ -n "$slope" ]; do # the last line may lack its end
    dt=${dt%"$ending"}                              # Windows ends lines with it
    require_number "$slope" SLOPE_DEG
    require_number "$dt" DT_S
    if [ "$torque" = brake ]; then acts='"brake": true'; else
        require_number "$torque" TORQUE_NM
        acts="\"torque_nm\": $torque"
    fi
    status=$(printf '{"rovers": [{"id": "rover", %s, "slope_deg": %s, "dt_s": %s, %s}]}' "$origin" "$slope" "$dt" "$acts" |
        curl --config "$token" --silent --show-error --connect-timeout 3 --max-time 60 --output "$answer" --write-out '%{http_code}' \
            --header 'Content-Type: application/json' --data-binary @- "${url%/}/v1/steps") || exit 1
    state=$(member state)
    if [ "$status" != 200 ] || [ -z "$state" ]; then complain "$(reason)" 1; fi
    printf '%s %s %s\n' "$(member time_s)" "$(member x_m)" "$(member speed_m_s)"
    origin="\"state\": \"$state\""
done
