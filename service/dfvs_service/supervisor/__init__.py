"""The parent process, and what its children share with it."""
