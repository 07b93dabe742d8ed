"""How the packages of an extra are installed, for the messages that ask for them."""


def install_command(*extras: str) -> str:
    """Command that installs the packages of one or more extras of `pyproject.toml`.

    There is no release on a package index, so the command names the folder with the sources.
    """
    return f"pip install '.[{','.join(extras)}]' in the folder of contactsense's sources"
