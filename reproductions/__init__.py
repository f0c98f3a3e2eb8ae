"""The five sources and the public recordings, reproduced, and the studies behind the result pages."""
