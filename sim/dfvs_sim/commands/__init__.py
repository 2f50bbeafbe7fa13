"""The subcommands of ``dfvs-sim``."""
