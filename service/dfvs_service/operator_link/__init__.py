"""The operator link process: state and answers out, commands in, whatever perception does."""
