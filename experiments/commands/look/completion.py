"""Print the lines that let a shell complete commands, options, scenarios and estimators.

example:
  eval "$(flexaxis completion bash)"                      in ~/.bashrc
  eval "$(flexaxis completion zsh)"                       in ~/.zshrc
  flexaxis completion fish > ~/.config/fish/completions/flexaxis.fish
"""

from __future__ import annotations

import argparse

HELP = "print what lets bash, zsh or fish complete words"
JSON = False
_ZSH = "#compdef flexaxis"  # to be the first line, for who puts it into a file
_BEGIN = "(( $+functions[compdef] )) || { autoload -U compinit && compinit }"


def configure(parser: argparse.ArgumentParser) -> None:
    """Declare the options."""
    parser.add_argument("shell", choices=("bash", "zsh", "fish"))


def main(args: argparse.Namespace) -> int:
    """Print it."""
    from argcomplete import shellcode

    text = shellcode(["flexaxis"], shell=args.shell)
    if args.shell == "zsh":
        text = text.replace(_ZSH, f"{_ZSH}\n{_BEGIN}", 1)
    print(text)
    return 0
