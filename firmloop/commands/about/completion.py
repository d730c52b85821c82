"""`firmloop completion`: what bash and zsh need to complete commands, options and their values."""

from __future__ import annotations

import argparse

from firmloop.commands import command_names, load_command
from firmloop.console import Console

NAME = "completion"
HELP = 'a script for bash and zsh that completes commands and options: eval "$(firmloop completion)"'

_SCRIPT = """\
# Completion of firmloop in bash and zsh: eval "$(firmloop completion)"
[ -n "$ZSH_VERSION" ] && autoload -U +X bashcompinit && bashcompinit
_firmloop() {{
    local word=${{COMP_WORDS[COMP_CWORD]}} last=${{COMP_WORDS[COMP_CWORD-1]}} words=
    if [ "$COMP_CWORD" -eq 1 ]; then
        words="{commands}"
    else
        case "${{COMP_WORDS[1]}} $last" in
{values}
        *)
            case "$word" in -*)
                case "${{COMP_WORDS[1]}}" in
{options}
                esac
            esac
        esac
    fi
    COMPREPLY=($(compgen -W "$words" -- "$word"))
}}
complete -o default -F _firmloop firmloop"""


def arguments(parser: argparse.ArgumentParser) -> None:
    """Ask for nothing."""


def run(arguments: argparse.Namespace, console: Console) -> int:
    """Show the script."""
    from firmloop.codegen.target import target_names

    options, values = [], []
    for name in command_names():
        parser = argparse.ArgumentParser()
        load_command(name).arguments(parser)
        parser.add_argument("--json")
        asked = [action for action in parser._actions if action.option_strings]
        flags = " ".join(flag for action in asked for flag in action.option_strings)
        options.append(f'                {name}) words="{flags}" ;;')
        for action in asked:
            known = target_names() if "--target" in action.option_strings else tuple(map(str, action.choices or ()))
            if known:
                values.append(f'        "{name} {action.option_strings[-1]}") words="{" ".join(known)}" ;;')
    script = _SCRIPT.format(commands=" ".join(command_names()), options="\n".join(options), values="\n".join(values))
    console.lines(script.splitlines())
    console.result("completion", script)
    return 0
