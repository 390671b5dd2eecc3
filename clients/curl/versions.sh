#!/bin/sh
# Takes versions out of use from a shell; `versions.sh --help` says how.
set -eu

usage() {
    cat <<'EOT'
usage: versions.sh list NAME
       versions.sh state|archive|restore|delete NAME VERSION [REASON]

Lists the versions of a model, says whether one can be used, archives it (it predicts no more, everything is kept),
restores it, or deletes it for good (its manifest stays). A version that an alias names stays in use.

ROVER_TWIN_URL is the service's address, http://127.0.0.1:8000 when not set.
ROVER_TWIN_TOKEN is a token of scope admin; `list` and `state` need none unless the service wants one for everything.
Exits: 0 done, 1 refused or failed (the reason on standard error), 2 wrong usage.

  ROVER_TWIN_TOKEN=$(cat ../training/token) versions.sh archive viper-lunar 2 "slides where the rover climbed"
EOT
}

complain() { # MESSAGE EXIT
    printf 'versions.sh: %s\n' "$1" >&2
    exit "$2"
}

case ${1:-} in
-h | --help)
    usage
    exit 0
    ;;
list) [ $# -eq 2 ] || { usage >&2; exit 2; } ;;
state | archive | restore | delete) [ $# -eq 3 ] || [ $# -eq 4 ] || { usage >&2; exit 2; } ;;
*)
    usage >&2
    exit 2
    ;;
esac
command -v curl >/dev/null || complain "curl is not installed" 1
case $2 in *[!a-z0-9-]* | '') complain "NAME is '$2', allowed is a-z, 0-9 and -" 2 ;; esac
case ${3:-1} in *[!0-9]* | '') complain "VERSION is '$3', which is no number" 2 ;; esac
case ${4:-} in *[[:cntrl:]]*) complain "REASON must be one line" 2 ;; esac

answer=$(mktemp)
token=$(mktemp) # a file that others cannot read, for they can read the arguments of a command
trap 'rm -f "$answer" "$token"' EXIT
trap 'exit 130' INT
trap 'exit 143' TERM
url=${ROVER_TWIN_URL:-http://127.0.0.1:8000}
[ -z "${ROVER_TWIN_TOKEN:-}" ] || printf '%s' "$ROVER_TWIN_TOKEN" | tr -d '\r\n' | sed 's/[\\"]/\\&/g' |
    sed 's/.*/header = "Authorization: Bearer &"/' >"$token"
place=models/$2/versions/${3:-1}
body="{\"reason\": \"$(printf '%s' "${4:-}" | sed 's/[\\"]/\\&/g')\"}"

ask() { # PATH [CURL OPTIONS]
    path=$1
    shift
    status=$(curl --config "$token" --silent --show-error --connect-timeout 3 --max-time 60 \
        --output "$answer" --write-out '%{http_code}' "$@" "${url%/}/$path") || exit 1
    if [ "$status" != 200 ]; then
        found=$(tr -d '\r\n' <"$answer" | sed -n 's/.*"detail" *: *"\(\([^"\\]\|\\.\)*\)".*/\1/p' | sed 's/\\\(["\\/]\)/\1/g')
        complain "${found:-the service answered $status}" 1
    fi
}

change() { # PATH [CURL OPTIONS]
    [ -n "${ROVER_TWIN_TOKEN:-}" ] || complain "ROVER_TWIN_TOKEN is not set" 2
    ask "$@"
}

case $1 in
list) ask "v1/models/$2" ;;
state) ask "v1/$place/state" ;;
delete) change "v1/admin/$place" --request DELETE --get --data-urlencode "reason=${4:-}" ;;
*) change "v1/admin/$place/$1" --header 'Content-Type: application/json' --data-binary "$body" ;;
esac
cat "$answer"
printf '\n'
