#!/bin/sh
# One prediction from a shell; `predict.sh --help` says how. The answer goes to standard output as the service
# sent it; a refusal or failure goes to standard error in one line, with a non-zero exit.
set -eu

usage() {
    cat <<'EOF'
usage: predict.sh [--csv] SLOPE_DEG MASS_KG TORQUE_NM [HORIZON_S]

Asks a rover-twin service where the rover goes. Slope in degrees (positive uphill), mass in kg, motor stall
torque per wheel in N m, horizon in seconds (by default 10).

  --csv     columns time_s,x_m,y_m in seconds and metres, instead of JSON
  --help    this text

ROVER_TWIN_URL is the service's address, http://127.0.0.1:8000 when not set. ROVER_TWIN_TOKEN is a token, for a
service that wants one.
Exits: 0 answered, 1 refused or failed (the reason on standard error), 2 wrong usage.

  predict.sh 28 430 60 10
  predict.sh --csv 28 430 60 > run.csv
EOF
}

complain() { # MESSAGE EXIT
    printf 'predict.sh: %s\n' "$1" >&2
    exit "$2"
}

reason() { # FILE: the problem's "detail" on one line, or the first line of another answer
    found=$(tr -d '\r\n' <"$1" | sed -n 's/.*"detail" *: *"\(\([^"\\]\|\\.\)*\)".*/\1/p' | sed 's/\\\(["\\/]\)/\1/g')
    if [ -n "$found" ]; then printf '%s' "$found"; else head -c 200 "$1" | head -n 1; fi
}

format=json
while [ $# -gt 0 ]; do
    case $1 in
    --csv) format=csv ;;
    -h | --help)
        usage
        exit 0
        ;;
    --)
        shift
        break
        ;;
    --*) complain "unknown option $1; see predict.sh --help" 2 ;;
    *) break ;; # the first number; a slope may start with a minus
    esac
    shift
done
if [ $# -lt 3 ] || [ $# -gt 4 ]; then
    usage >&2
    exit 2
fi
command -v curl >/dev/null || complain "curl is not installed" 1

answer=$(mktemp)
token=$(mktemp) # a file that others cannot read, for they can read the arguments of a command
trap 'rm -f "$answer" "$token"' EXIT
trap 'exit 130' INT
trap 'exit 143' TERM
url=${ROVER_TWIN_URL:-http://127.0.0.1:8000}
[ -z "${ROVER_TWIN_TOKEN:-}" ] || printf '%s' "$ROVER_TWIN_TOKEN" | tr -d '\r\n' | sed 's/[\\"]/\\&/g' |
    sed 's/.*/header = "Authorization: Bearer &"/' >"$token"

# --data-urlencode keeps whatever was typed inside its own parameter.
status=$(curl --config "$token" --silent --show-error --get --connect-timeout 3 --max-time 60 \
    --output "$answer" --write-out '%{http_code}' \
    --data-urlencode "slope_deg=$1" --data-urlencode "mass_kg=$2" --data-urlencode "torque_nm=$3" \
    --data-urlencode "horizon_s=${4:-10}" --data-urlencode "format=$format" \
    "${url%/}/v1/predictions") || exit 1 # curl has said why

[ "$status" = 200 ] || complain "$(reason "$answer") (HTTP $status)" 1
cat "$answer"
