"""The page in a browser: what happens now, and four buttons. Reads messages, owns nothing, decides nothing."""
