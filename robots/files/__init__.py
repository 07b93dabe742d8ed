"""Files that people write, and files that programs do.

What is read is YAML without double keys (`yaml_fields`) for models that refuse unknown fields (`file_model`);
what is wrong is said in words (`field_errors`, `field_places`, `near_names`). What is written is there whole
or not at all (`whole_file`), and locks are those of the operating system (`file_lock`).
"""
