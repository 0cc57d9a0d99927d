"""What runs leave on disk: the cache of costly stages, the folder a person reads, and their schemas."""
