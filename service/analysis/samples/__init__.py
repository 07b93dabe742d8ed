"""The samples of a contact: `contact_history` keeps them in bounded memory until it ends; `contact_windows`
and `link_windows` are their means."""
