# bash completion for dmkcl: commands, options, surfaces and suffixes are read from the tool's own help.

# The part of the help on one option of a command, in one line.
_dmkcl_option_help()
{
    dmkcl "$1" --help 2> /dev/null | awk -v option="$2" '
        $1 == option { on = 1; printf "%s", $0; next }
        on && /^ *--|^$/ { exit }
        on { printf " %s", $0 }'
}

# Words that may follow an option, one a line; none for numbers and free text.
_dmkcl_values()
{
    case $2 in
    --method) echo 'newton inertial euler' ;;
    --start) echo 'distance uniform' ;;
    --device) dmkcl devices 2> /dev/null | sed -n 's/^  \([0-9][0-9]*\)  .*/\1/p' ;;
    --report) echo '-' ;;
    --format) _dmkcl_option_help "$1" "$2" | sed 's/.*suffix: \([^;]*\);.*/\1/; s/,//g' ;;
    --from | --to) [ "$1" = transport ] && echo uniform ;;
    esac
}

# Suffixes of the files that an option takes, as "vtp|obj"; empty for any file.
_dmkcl_suffixes()
{
    local help
    case $2 in
    --out | --locus | --tangent | --report)
        [ "$2" = --tangent ] && { echo csv; return; }
        [ "$2" = --report ] && { echo 'jsonl?'; return; }
        help=$(_dmkcl_option_help "${1/batch/solve}" "$2") # which lists all
        grep -o ' \.[a-z]*' <<< "$help" | tr -d ' .' | paste -sd '|' ;;
    --sources) echo txt ;;
    --picture) echo svg ;;
    mesh) # what is read, by the README's table
        [ "$1" = batch ] && printf 'txt|list|'
        echo 'ply|vtp|vtu|vtk|msh|off|coff|noff|obj|stl|gz' ;;
    esac
}

# Files with one of the suffixes, and folders; any file if there is none.
_dmkcl_files()
{
    local suffixes=$1 word=$2 name
    if [ -z "$suffixes" ]; then
        compgen -f -- "$word"
        return
    fi
    compgen -d -- "$word"
    compgen -f -- "$word" | while IFS= read -r name; do
        [[ ! -d $name && ${name,,} =~ \.($suffixes)$ ]] && printf '%s\n' "$name"
    done
}

_dmkcl()
{
    local word=${COMP_WORDS[COMP_CWORD]} before=${COMP_WORDS[COMP_CWORD - 1]}
    local command=${COMP_WORDS[1]} words='' suffixes=''
    COMPREPLY=()
    if [ "$COMP_CWORD" -eq 1 ] || [ "$COMP_CWORD:$command" = 2:help ]; then
        words="$(dmkcl --help 2> /dev/null | sed -n '/^commands:/,/^$/s/^  \([a-z]*\) .*/\1/p')"
        [ "$COMP_CWORD" -eq 1 ] && words="$words help --help --version"
    elif [[ $before == --* && $(_dmkcl_option_help "$command" "$before") =~ ^\ *--[a-z-]+\ ([A-Z]+) ]]
    then # the option takes a value
        words=$(_dmkcl_values "$command" "$before")
        suffixes=$(_dmkcl_suffixes "$command" "$before")
        case ${BASH_REMATCH[1]} in
        FILE) mapfile -t COMPREPLY < <(_dmkcl_files "$suffixes" "$word") ;;
        SUFFIX) words=.${suffixes//|/ .} ;;
        DIR) mapfile -t COMPREPLY < <(compgen -d -- "$word") ;;
        esac
    elif [[ $word == -* ]]; then
        words=$(dmkcl "$command" --help 2> /dev/null | sed -n 's/^  \(--[a-z-]*\).*/\1/p')
    else
        [ "$command" = mesh ] && [ "$COMP_CWORD" -eq 2 ] &&
            words=$(dmkcl mesh --help 2> /dev/null | sed -n '/^surfaces:/,$s/^  \([a-z]*\) .*/\1/p')
        [[ $command == devices || $command == help ]] ||
            mapfile -t COMPREPLY < <(_dmkcl_files "$(_dmkcl_suffixes "$command" mesh)" "$word")
    fi
    [ -n "$words" ] && COMPREPLY+=($(compgen -W "$words" -- "$word"))
}
complete -o filenames -F _dmkcl dmkcl
