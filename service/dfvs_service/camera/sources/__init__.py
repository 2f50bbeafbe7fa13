"""Image sources: cameras, streams, videos and folders of images."""
