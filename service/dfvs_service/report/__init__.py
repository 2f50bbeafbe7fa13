"""Reports of flights as HTML pages that need nothing else."""
