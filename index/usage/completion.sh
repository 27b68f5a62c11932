#compdef pliant pliant-server
# shellcheck shell=bash
# SPDX-FileCopyrightText: The Pliant authors
# SPDX-License-Identifier: Apache-2.0
# Completion of pliant and pliant-server for bash and zsh: commands, options and values from --help, else files.

_pliant_complete() {
  if [ -n "${ZSH_VERSION-}" ]; then emulate -L ksh; fi # arrays begin at 0
  local cur=${COMP_WORDS[COMP_CWORD]} prev=${COMP_WORDS[COMP_CWORD - 1]} word help candidates
  local -a command
  command=("${COMP_WORDS[0]}")
  for word in "${COMP_WORDS[@]:1:$((COMP_CWORD - 1))}"; do
    case $word in
      *[!a-z]*) break ;; # options and files come after the commands
      *) command+=("$word") ;;
    esac
  done
  # --option=value is three words.
  if [ "$cur" = = ]; then cur=; elif [ "$prev" = = ]; then prev=${COMP_WORDS[COMP_CWORD - 2]}; fi
  help=$("${command[@]}" --help 2>/dev/null)
  case $prev in
    --*) candidates=$(sed -nE "s/^ .*$prev ([a-z0-9-]+(\|[a-z0-9-]+)+).*/\1/p" <<<"$help" | tr '|' ' ') ;;
  esac
  if [ -z "$candidates" ]; then
    case $cur in
      -*) candidates=$(sed -nE 's/^  (-[-a-zA-Z,]+).*/\1/p' <<<"$help" | tr ',\n' '  ') ;;
      *) candidates=$(sed -nE '/^subcommands:/I,/^$/s/^  ([a-z]+) .*/\1/p' <<<"$help" | tr '\n' ' ') ;;
    esac
  fi
  # shellcheck disable=SC2207  # no mapfile in zsh; candidates have no spaces
  COMPREPLY=($(compgen -W "$candidates" -- "$cur"))
}

if [ -n "${ZSH_VERSION-}" ]; then autoload -U +X bashcompinit && bashcompinit; fi
complete -o default -F _pliant_complete pliant pliant-server
# zsh loads this file as the function _pliant at the first completion, and expects its result.
if [ -n "${ZSH_VERSION-}" ]; then _bash_complete -o default -F _pliant_complete; fi
