"""Events: what happens to contacts, kept in a journal on disk and sent to readers that must not miss any."""
