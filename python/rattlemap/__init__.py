from .folder import open
