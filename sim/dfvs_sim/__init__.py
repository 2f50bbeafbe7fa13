"""The virtual world: scenes, renderer, simulated vehicle and camera, and the demo."""
