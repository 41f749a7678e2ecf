# SPDX-License-Identifier: Apache-2.0
"""activestereo completion bash | zsh: the script by which a shell completes commands and options."""

from __future__ import annotations

import argparse
from collections.abc import Iterator

from activestereo.cli.arguments import Commands

_TEXT = """\
Prints the script by which bash or zsh completes commands, options and their choices;
what is no such name is completed as a file.

examples:
  activestereo completion bash > ~/.local/share/bash-completion/completions/activestereo
  activestereo completion zsh > ~/.zsh/_activestereo    # a folder of $fpath, before compinit
"""
# The words of each command line so far decide; a table has one line for each command and each option with choices.
_BASH = """\
# Written by activestereo completion.
_activestereo() {
  local current=${COMP_WORDS[COMP_CWORD]} before=${COMP_WORDS[COMP_CWORD-1]} path= word words
  for word in "${COMP_WORDS[@]:1:COMP_CWORD-1}"; do
    case " $(_activestereo_words "$path") " in *" $word "*) [[ $word == -* ]] || path="$path $word" ;; esac
  done
  words=$(_activestereo_words "$path $before")
  [[ $before == -* && -n $words ]] || words=$(_activestereo_words "$path")
  COMPREPLY=($(compgen -W "$words" -- "$current"))
  [ ${#COMPREPLY[@]} -gt 0 ] || COMPREPLY=($(compgen -f -- "$current"))
}
_activestereo_words() {
  case "$1" in
TABLE
  esac
}
complete -o filenames -F _activestereo activestereo
"""
_ZSH = "#compdef activestereo\nautoload -U +X bashcompinit && bashcompinit\n"


def add_parser(commands: Commands) -> None:
    text = "print the script that completes commands in a shell"
    parser = commands.add_parser("completion", help=text, description=_TEXT)
    parser.add_argument("shell", choices=("bash", "zsh"), help="which shell's")
    parser.set_defaults(run=run)


def run(args: argparse.Namespace) -> None:
    lines = [f'    "{path}") echo "{" ".join(words)}" ;;' for path, words in _table(args.parser, "")]
    script = _BASH.replace("TABLE", "\n".join(lines))
    print((_ZSH if args.shell == "zsh" else "") + script, end="")


def _table(parser: argparse.ArgumentParser, path: str) -> Iterator[tuple[str, list[str]]]:
    """(the words so far, what may follow): commands and options of each command, choices of each option."""
    words = [name for name in parser._option_string_actions if name.startswith("--")]
    for action in parser._actions:
        choices = [str(choice) for choice in action.choices or ()]
        if not action.option_strings:
            words += choices
        for name in action.option_strings if choices else ():
            yield f"{path} {name}", choices
        if isinstance(action, argparse._SubParsersAction):
            for name, inner in action.choices.items():
                yield from _table(inner, f"{path} {name}")
    yield path, words
