"""What the subcommands of ``dfvs-export`` do."""
