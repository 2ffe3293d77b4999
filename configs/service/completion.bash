# Bash completion for huetrack, huetrackd and huetrack-calibrate: what their own --help says, so that it is never behind.
# Installed under each program's name in share/bash-completion/completions; `source` it to have it at once.

# Options and sub-commands are words of a help's lines; the choices of a value stand behind it: {text,csv} or max|real.
# What `huetrack control` is asked stands below "The words:", a first word and what may follow it, separated by ", ".
_huetrack_complete() {
  local program=${COMP_WORDS[0]} current=${COMP_WORDS[COMP_CWORD]} previous=${COMP_WORDS[COMP_CWORD - 1]}
  local command="" word help words
  COMPREPLY=()
  for word in "${COMP_WORDS[@]:1:COMP_CWORD-1}"; do
    case $word in -*) ;; *) command=$word && break ;; esac
  done
  help=$("$program" ${command:+"$command"} --help 2>/dev/null) || help=$("$program" --help 2>/dev/null) || return 0
  if [[ $previous == --* && $current != -* ]]; then
    words=$(sed -n "s/^  \(-[a-z],\)\{0,1\}$previous [A-Z]*:{\([^}]*\)}.*/\2/p; s/^  $previous \([a-z]*|[a-z|]*\).*/\1/p" <<<"$help" | tr ',|' '  ')
    if [ -n "$words" ]; then
      mapfile -t COMPREPLY < <(compgen -W "$words" -- "$current")
      return 0
    fi
  elif [[ $current == -* ]]; then
    words=$(sed -n 's/^  \(-[a-z],\)\{0,1\}\(--[a-z][a-z-]*\).*/\2/p' <<<"$help")
    mapfile -t COMPREPLY < <(compgen -W "$words" -- "$current")
    return 0
  elif [ -z "$command" ]; then
    words=$(sed -n '/^Subcommands:/,$ s/^  \([a-z][a-z-]*\) .*/\1/p' <<<"$help")
    mapfile -t COMPREPLY < <(compgen -W "$words" -- "$current")
    return 0
  elif [ "$command" = control ]; then
    local said="" count=-1 is_value=false # of the words before this one, the command's own is the first
    for word in "${COMP_WORDS[@]:1:COMP_CWORD-1}"; do
      if $is_value; then is_value=false; continue; fi
      case $word in -*) is_value=true ;; *) count=$((count + 1)); [ $count -eq 1 ] && said=$word ;; esac
    done
    [ $count -le 1 ] || return 0
    words=$(awk -v said="$said" '
      function offer(word) { if (!offered[word]++) print word }
      is_on && said == "" { offer($1) }
      is_on && said != "" && $1 == said { sub(/^ *[^ ]+ ?/, ""); n = split($0, requests, ", ")
                                          for (i = 1; i <= n; ++i) { split(requests[i], parts, " "); offer(parts[1]) } }
      /^The words:/ { is_on = 1 }' <<<"$help")
    mapfile -t COMPREPLY < <(compgen -W "$words" -- "$current")
    return 0
  fi
  compopt -o default 2>/dev/null  # files
}
complete -F _huetrack_complete huetrack huetrackd huetrack-calibrate
