"""Events of contacts, stored in a journal on disk and sent to readers that must not miss any."""
