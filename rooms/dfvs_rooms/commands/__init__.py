"""The subcommands of ``dfvs-rooms``."""
