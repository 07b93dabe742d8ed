"""Analysis of many recordings of many robots: in segments, on many processes, resumable."""
