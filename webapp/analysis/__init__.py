"""Statistics: tables in, tables out. Nothing here reads files, knows an experiment's protocol or draws."""
