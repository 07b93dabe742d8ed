"""The contactsense command."""
