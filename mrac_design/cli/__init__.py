"""The `mrac` command: one module a group of commands, joined in `app`."""
