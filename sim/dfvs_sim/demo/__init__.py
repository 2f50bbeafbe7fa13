"""``dfvs-demo``: the whole chain on one machine, and a folder that shows how it went."""
