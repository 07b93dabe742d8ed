"""`python -m contactsense` is the command `contactsense`."""

from contactsense.service.cli.main import main

if __name__ == "__main__":
    main()
