#!/bin/sh
# An operator's day from a shell: data in, a training, a version into use and back; `operator.sh --help` says how.
set -eu

usage() {
    cat <<'EOT'
usage: operator.sh check FILE                        what would become of an upload; nothing is stored
       operator.sh upload FILE NAME                  store a dataset: zip, tar, one run or a table, gzipped or not
       operator.sh datasets [NAME_OR_ID]             all datasets, or one
       operator.sh delete-dataset ID                 takes the whole id; refused while something uses it
       operator.sh train MODEL DATASET...            start a training job; its answer has the job's id
       operator.sh follow JOB                        its events until it ends; exit code 1 unless it succeeded
       operator.sh jobs [JOB]                        the newest jobs, or one
       operator.sh cancel JOB
       operator.sh compare MODEL VERSION [AGAINST]   two versions side by side; AGAINST is NAME[@VERSION|@ALIAS]
       operator.sh promote MODEL VERSION REASON      point champion to a version
       operator.sh rollback MODEL REASON             take the last move of champion back
       operator.sh history MODEL                     who moved champion, when and why

ROVER_TWIN_URL is the service's address, http://127.0.0.1:8000 when not set. ROVER_TWIN_TOKEN is a token of scope admin;
compare and history need none unless the service wants one for everything. ROVER_TWIN_TRAIN adds members to the job,
such as '"architecture": "drive_model", "promote": "if_better"'. Archive and delete versions with versions.sh.
Exits: 0 done, 1 refused or failed (the reason on standard error), 2 wrong usage.

  operator.sh check runs.tar.gz && operator.sh upload runs.tar.gz my-runs
EOT
}

complain() { # MESSAGE EXIT
    printf 'operator.sh: %s\n' "$1" >&2
    exit "$2"
}

wrong() {
    usage >&2
    exit 2
}

require_name() { # TEXT NAME
    case $1 in *[!a-zA-Z0-9._@-]* | '') complain "$2 is '$1', allowed are letters, digits and . _ @ -" 2 ;; esac
}

require_count() { # TEXT
    case $1 in *[!0-9]* | '') complain "VERSION is '$1', which is no number" 2 ;; esac
}

quoted() { # TEXT: as JSON
    case $1 in *[[:cntrl:]]*) complain "REASON must be one line" 2 ;; esac
    printf '"%s"' "$(printf '%s' "$1" | sed 's/[\\"]/\\&/g')"
}

word=${1:-}
case $word in
-h | --help)
    usage
    exit 0
    ;;
check | delete-dataset | follow | cancel | history) [ $# -eq 2 ] || wrong ;;
datasets | jobs) [ $# -le 2 ] || wrong ;;
upload | rollback) [ $# -eq 3 ] || wrong ;;
train) [ $# -ge 3 ] || wrong ;;
compare) [ $# -eq 3 ] || [ $# -eq 4 ] || wrong ;;
promote) [ $# -eq 4 ] || wrong ;;
*) wrong ;;
esac
shift
command -v curl >/dev/null || complain "curl is not installed" 1

answer=$(mktemp)
token=$(mktemp) # a file that others cannot read, for they can read the arguments of a command
head=$(mktemp)
trap 'rm -f "$answer" "$token" "$head"' EXIT
trap 'exit 130' INT
trap 'exit 143' TERM
url=${ROVER_TWIN_URL:-http://127.0.0.1:8000}
url=${url%/}
[ -z "${ROVER_TWIN_TOKEN:-}" ] || printf '%s' "$ROVER_TWIN_TOKEN" | tr -d '\r\n' | sed 's/[\\"]/\\&/g' |
    sed 's/.*/header = "Authorization: Bearer &"/' >"$token"

require_token() {
    [ -n "${ROVER_TWIN_TOKEN:-}" ] || complain "ROVER_TWIN_TOKEN is not set" 2
}

ask() { # PATH [CURL OPTIONS]: leaves the answer in its file; anything but success is told in one line
    path=$1
    shift
    status=$(curl --config "$token" --silent --show-error --connect-timeout 3 --max-time "${seconds:-60}" \
        --dump-header "$head" --output "$answer" --write-out '%{http_code}' "$@" "$url/$path") || exit 1
    case $status in 2??) return ;; esac
    found=$(tr -d '\r\n' <"$answer" | sed -n 's/.*"detail" *: *"\(\([^"\\]\|\\.\)*\)".*/\1/p' | sed 's/\\\(["\\/]\)/\1/g')
    complain "${found:-the service answered something else} (HTTP $status)" 1
}

send() { # PATH BODY [CURL OPTIONS]
    path=$1 body=$2
    shift 2
    ask "$path" --header 'Content-Type: application/json' --data-binary "$body" "$@"
}

show() {
    cat "$answer"
    printf '\n'
}

upload() { # FILE QUERY [CURL OPTIONS]
    [ ! -d "$1" ] || complain "$1 is a directory; pack it first: tar -czf FILE.tar.gz $1" 2
    [ -r "$1" ] || complain "$1 cannot be read" 2
    case $1 in *[\;\,\"]*) complain "$1 has a character in its name that curl takes for its own" 2 ;; esac
    file=$1 query=$2
    shift 2
    seconds=3600 ask "v1/admin/datasets$query" --form "file=@$file" "$@"
    show
}

move() { # PATH BODY [CURL OPTIONS]: only if nobody moves champion meanwhile
    ask "v1/models/$model/aliases/champion"
    etag=$(tr -d '\r' <"$head" | sed -n 's/^[Ee][Tt][Aa][Gg]: *//p')
    send "$@" --header "If-Match: ${etag:-*}"
    show
}

follow() { # JOB
    ask "v1/admin/training-jobs/$1" # says in one line what is wrong where there is no such job or no service
    curl --config "$token" --silent --no-buffer --fail --connect-timeout 3 --dump-header "$head" \
        "$url/v1/admin/training-jobs/$1/events" >&2 || {
        code=$?
        status=$(sed -n '1s/^[^ ]* \([0-9]*\).*/\1/p' "$head")
        [ $code -ne 22 ] || complain "the service gave no events of $1 (HTTP $status)" 1
        complain "the events of $1 broke off (exit code $code of curl); operator.sh jobs $1 says how it stands" 1
    }
    ask "v1/admin/training-jobs/$1"
    show
    state=$(tr -d '\r\n' <"$answer" | sed -n 's/.*"state" *: *"\([a-z]*\)".*/\1/p')
    [ "$state" = succeeded ] || complain "job $1 is $state" 1
}

case $word in compare | history) ;; *) require_token ;; esac
case $word in
check) upload "$1" '?dry_run=true' ;;
upload)
    require_name "$2" NAME
    upload "$1" '' --form "name=$2"
    ;;
datasets | jobs)
    place=v1/admin/$([ "$word" = jobs ] && printf training-jobs || printf datasets)
    [ $# -eq 0 ] || require_name "$1" NAME
    ask "$place${1:+/$1}"
    show
    ;;
delete-dataset)
    require_name "$1" ID
    ask "v1/admin/datasets/$1" --request DELETE
    ;;
train)
    require_name "$1" MODEL
    model=$1 names=''
    shift
    for dataset; do
        require_name "$dataset" DATASET
        names="$names${names:+, }\"$dataset\""
    done
    send v1/admin/training-jobs "{\"model\": \"$model\", \"datasets\": [$names]${ROVER_TWIN_TRAIN:+, $ROVER_TWIN_TRAIN}}"
    show
    ;;
follow)
    require_name "$1" JOB
    follow "$1"
    ;;
cancel)
    require_name "$1" JOB
    ask "v1/admin/training-jobs/$1/cancel" --request POST
    show
    ;;
compare)
    require_name "$1" MODEL
    require_count "$2"
    [ -z "${3:-}" ] || require_name "$3" AGAINST
    ask "v1/models/$1/versions/$2/comparison${3:+?against=$3}"
    show
    ;;
promote)
    require_name "$1" MODEL
    require_count "$2"
    model=$1
    reason=$(quoted "$3")
    move "v1/models/$1/aliases/champion" "{\"version\": $2, \"reason\": $reason}" --request PUT
    ;;
rollback)
    require_name "$1" MODEL
    model=$1
    reason=$(quoted "$2")
    move "v1/models/$1/aliases/champion/rollback" "{\"reason\": $reason}"
    ;;
history)
    require_name "$1" MODEL
    ask "v1/models/$1/aliases/champion/history"
    show
    ;;
esac
