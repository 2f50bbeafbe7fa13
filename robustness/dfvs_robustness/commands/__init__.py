"""The subcommands of ``dfvs-robustness``."""
