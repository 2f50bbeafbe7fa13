"""The servoing benchmark: tasks in rooms, methods behind one interface, and what came of them."""
