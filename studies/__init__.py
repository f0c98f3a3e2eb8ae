"""Published results reproduced, a folder a source; learned policies on trial; the tour; speed."""
