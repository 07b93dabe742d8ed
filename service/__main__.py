"""`python -m contactsense.service` is `contactsense`."""

from contactsense.service.cli.main import main

if __name__ == "__main__":
    main()
