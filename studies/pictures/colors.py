"""The colours of lines in all pictures."""

#: Colours that people with any colour vision tell apart (Okabe and Ito), the darker ones first.
COLORS = ("#0072B2", "#D55E00", "#009E73", "#CC79A7", "#E69F00", "#56B4E9", "#000000")
