//! stub
#[derive(Debug, Clone, PartialEq)]
pub struct Expression {}
#[derive(Debug, Clone, PartialEq)]
pub struct ExpressionError {
    pub span: std::ops::Range<usize>,
    pub what: String,
    pub hint: String,
}
impl Expression {
    pub fn parse(_s: &str, _n: &[&str]) -> Result<Self, ExpressionError> {
        Err(ExpressionError {
            span: 0..0,
            what: "stub".into(),
            hint: String::new(),
        })
    }
    pub fn value(&self, _v: &[f64]) -> f64 {
        0.0
    }
    pub fn source(&self) -> &str {
        ""
    }
    pub fn uses(&self, _v: usize) -> bool {
        false
    }
    pub fn constant(&self) -> Option<f64> {
        None
    }
}
