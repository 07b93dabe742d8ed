"""`python -m service` is `contactsense`."""

from service.cli.main import main

if __name__ == "__main__":
    main()
