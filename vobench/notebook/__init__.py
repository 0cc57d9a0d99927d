"""What `import vobench` offers: everything that the command line can do, with results as Python objects."""
