"""What happened: `summarize` makes a `contact_summary`, from onset to release, with the `force_limits` that
it exceeds and what remains open (`undetermined_forces`, `other_links`)."""
