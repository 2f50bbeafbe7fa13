"""Generator of furnished rooms, and the baking of light."""
