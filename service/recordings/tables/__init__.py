"""Tables of numbers in files: CSV, Arrow, Parquet and folders of it, batch by batch."""
