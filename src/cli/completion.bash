# bash completion for dmkcl: commands and options are read from the tool's own help.
_dmkcl()
{
    local word=${COMP_WORDS[COMP_CWORD]} before=${COMP_WORDS[COMP_CWORD - 1]} words
    if [ "$COMP_CWORD" -eq 1 ]; then
        words="$(dmkcl --help 2> /dev/null | sed -n '/^commands:/,/^$/s/^  \([a-z]*\) .*/\1/p')"
        words="$words --help --version"
    elif [[ $word == -* ]]; then
        words=$(dmkcl "${COMP_WORDS[1]}" --help 2> /dev/null | sed -n 's/^  \(--[a-z-]*\).*/\1/p')
    elif [ "${COMP_WORDS[1]}" = mesh ] && [ "$COMP_CWORD" -eq 2 ]; then
        words=$(dmkcl mesh --help 2> /dev/null | sed -n '/^surfaces:/,$s/^  \([a-z]*\) .*/\1/p')
    elif [ "$before" = --method ]; then
        words='newton inertial euler'
    elif [ "$before" = --start ]; then
        words='distance uniform'
    fi
    if [ -n "$words" ]; then
        mapfile -t COMPREPLY < <(compgen -W "$words" -- "$word")
    else
        mapfile -t COMPREPLY < <(compgen -f -- "$word")
    fi
}
complete -o filenames -F _dmkcl dmkcl
