"""The command as it is typed, without a process of its own."""

from flexaxis.experiments.cli import main


def flexaxis(capsys, *words):
    """Return exit status, stdout and stderr."""
    status = main([str(word) for word in words])
    out, err = capsys.readouterr()
    return status, out, err
