"""Tables and figures that commands and studies share."""
