"""The subcommands of ``dfvs-bench``."""
