//! `#[derive(Describe)]`, see `elk_describe::Describe`, and `#[payload]`, see `elk_bus::payload`.

use proc_macro2::TokenStream;
use quote::{format_ident, quote};
use syn::ext::IdentExt;
use syn::spanned::Spanned;
use syn::{Attribute, Data, DeriveInput, Error, Expr, ExprLit, Field, Fields, Lit, Meta, Path, Result};

/// Describes a struct or an enum by its definition.
#[proc_macro_derive(Describe, attributes(describe))]
pub fn derive(input: proc_macro::TokenStream) -> proc_macro::TokenStream {
    let input = syn::parse_macro_input!(input as DeriveInput);
    describe(&input).unwrap_or_else(Error::into_compile_error).into()
}

/// Makes a struct or an enum the value of a key: serde's derives, the description, and `Payload` itself.
#[proc_macro_attribute]
pub fn payload(arguments: proc_macro::TokenStream, item: proc_macro::TokenStream) -> proc_macro::TokenStream {
    let input = syn::parse_macro_input!(item as DeriveInput);
    travelling(&arguments.into(), &input).unwrap_or_else(Error::into_compile_error).into()
}

fn travelling(arguments: &TokenStream, input: &DeriveInput) -> Result<TokenStream> {
    if !arguments.is_empty() {
        return Err(Error::new(arguments.span(), "payload has no arguments: #[describe(…)] says what a field may be"));
    }
    let (ident, name) = (&input.ident, input.ident.unraw().to_string());
    let borrows: Vec<_> = input.generics.lifetimes().collect();
    let (own, view) = match (borrows.as_slice(), input.generics.params.len()) {
        ([], 0) => (quote! { #ident }, quote! { #ident }),
        ([_], 1) => (quote! { #ident<'static> }, quote! { #ident<'a> }),
        _ => {
            let said = "a payload is one type: at most a lifetime, of what it borrows from the message, can be open in it. Of a \
                 generic type derive `Describe`, `Serialize` and `Deserialize`, and make a payload of a struct with a field \
                 of the one that is meant";
            return Err(Error::new(input.generics.span(), said));
        }
    };
    Ok(quote! {
        #[derive(::elk_bus::serde::Serialize, ::elk_bus::serde::Deserialize, ::elk_bus::describe::Describe)]
        #[serde(crate = "::elk_bus::serde")]
        #[describe(crate = ::elk_bus::describe)]
        #input

        #[automatically_derived]
        impl ::elk_bus::Payload for #own {
            const NAME: &'static str = #name;
            type View<'a> = #view;
        }
    })
}

fn describe(input: &DeriveInput) -> Result<TokenStream> {
    plain_serde(&input.attrs)?;
    let said = Said::of(&input.attrs)?;
    said.only_of_types(input.span())?;
    not_in_itself(input)?;
    let krate = said.krate.clone().unwrap_or_else(|| syn::parse_quote! { ::elk_describe });
    // A name that is a keyword is the same name to serde.
    let (name, docs) = (input.ident.unraw().to_string(), docs(&input.attrs));
    let has_fields = matches!(&input.data, Data::Struct(data) if matches!(data.fields, Fields::Named(_)));
    if let Some(word) = said.drawn.as_ref().filter(|_| !has_fields) {
        return Err(Error::new(word.span(), "what is drawn is a struct with named fields"));
    }
    let drawn = said.drawn.as_ref().map(syn::LitStr::value).unwrap_or_default();
    let (shape, check) = match &input.data {
        Data::Struct(data) => {
            let all = Members::of(&data.fields)?;
            let bind = all.iter().map(|one| {
                let (name, member) = (&one.binding, &one.member);
                quote! { let #name = &self.#member; }
            });
            let checks = all.iter().map(Members::check);
            let check = quote! { #(#bind)* #(#checks)* };
            let shape = match (&data.fields, all.as_slice()) {
                (Fields::Unit, _) => quote! { describing::Shape::Unit },
                // As serde has it, a struct of one value without a name is that value.
                (Fields::Unnamed(_), [one]) => one.unnamed(),
                (Fields::Unnamed(_), all) => tuple(all),
                (Fields::Named(_), all) => {
                    let fields = fields(all);
                    quote! {
                        describing::Shape::Struct(&describing::StructShape {
                            name: #name, docs: #docs, drawn: #drawn, fields: #fields,
                        })
                    }
                }
            };
            (shape, check)
        }
        Data::Enum(data) => {
            let (mut variants, mut arms) = (Vec::new(), Vec::new());
            for variant in &data.variants {
                plain_serde(&variant.attrs)?;
                if let Some(said) = variant.attrs.iter().find(|one| one.path().is_ident("describe")) {
                    return Err(Error::new(said.span(), "a variant's rules stand at its fields, or at the enum"));
                }
                let (ident, said) = (&variant.ident, self::docs(&variant.attrs));
                let variant_name = ident.unraw().to_string();
                let all = Members::of(&variant.fields)?;
                let content = match (&variant.fields, all.as_slice()) {
                    (Fields::Unit, _) => quote! { Unit },
                    (Fields::Unnamed(_), [one]) => {
                        let shape = one.unnamed();
                        quote! { One(#shape) }
                    }
                    (Fields::Unnamed(_), all) => {
                        let shapes = all.iter().map(Members::unnamed);
                        quote! { Tuple(&[#(#shapes),*]) }
                    }
                    (Fields::Named(_), all) => {
                        let fields = fields(all);
                        quote! { Fields(#fields) }
                    }
                };
                variants.push(quote! {
                    describing::VariantShape {
                        name: #variant_name, docs: #said, content: describing::VariantContent::#content,
                    }
                });
                let (members, bindings): (Vec<_>, Vec<_>) = all.iter().map(|one| (&one.member, &one.binding)).unzip();
                let checks = all.iter().map(Members::check);
                let check = quote! { #(#checks)* };
                let within = quote! {
                    let checked: ::core::result::Result<(), describing::Invalid> = (|| { #check ::core::result::Result::Ok(()) })();
                    checked.map_err(|inner| inner.within(#variant_name))?;
                };
                arms.push(quote! { Self::#ident { #(#members: #bindings),* } => { #within } });
            }
            let shape = quote! { describing::Shape::Enum(&describing::EnumShape {
                name: #name, docs: #docs, variants: &[#(#variants),*],
            }) };
            (shape, quote! { match self { #(#arms)* } })
        }
        Data::Union(_) => return Err(Error::new(input.span(), "a union has no bytes that serde knows")),
    };
    let own = said.check.map(|path| quote! { #path(self)?; });
    let (ident, mut generics) = (&input.ident, input.generics.clone());
    for parameter in input.generics.type_params() {
        let ident = &parameter.ident;
        generics.make_where_clause().predicates.push(syn::parse_quote! { #ident: describing::Describe });
    }
    let (implementation, types, bounds) = generics.split_for_impl();
    // What cannot be described does not compile where it is defined, and not only where it is used.
    let has_types = generics.type_params().next().is_some() || generics.const_params().next().is_some();
    let lifetimes = generics.lifetimes().map(|_| quote! { '_ });
    let at_once = (!has_types).then(|| {
        quote! { const _: describing::Shape = <#ident<#(#lifetimes),*> as describing::Describe>::SHAPE; }
    });
    Ok(quote! {
        const _: () = {
            use #krate as describing;

            #[automatically_derived]
            impl #implementation describing::Describe for #ident #types #bounds {
                const SHAPE: describing::Shape = describing::derived::sound(#shape);

                #[allow(clippy::manual_range_contains, clippy::redundant_closure_call)]
                fn check(&self) -> ::core::result::Result<(), describing::Invalid> {
                    #check
                    #own
                    ::core::result::Result::Ok(())
                }
            }

            #at_once
        };
    })
}

/// A type that lies in itself has no description that ends; the compiler would say so of a constant that nobody has seen.
fn not_in_itself(input: &DeriveInput) -> Result<()> {
    let fields: Vec<&Field> = match &input.data {
        Data::Struct(data) => data.fields.iter().collect(),
        Data::Enum(data) => data.variants.iter().flat_map(|variant| &variant.fields).collect(),
        Data::Union(_) => Vec::new(),
    };
    let ident = input.ident.to_string();
    let in_itself = fields.into_iter().find(|field| {
        let ty = &field.ty;
        let has_shape = Said::of(&field.attrs).is_ok_and(|said| said.shape.is_some());
        !has_shape && names(quote! { #ty }, &ident)
    });
    match in_itself {
        Some(field) => Err(Error::new(
            field.ty.span(),
            "a type that lies in itself cannot be described: of a tree, say a list of nodes, each with the number of its parent",
        )),
        None => Ok(()),
    }
}

/// Whether a type of this name is named, and not one of another module that is called the same.
fn names(ty: TokenStream, ident: &str) -> bool {
    let mut behind_path = false;
    ty.into_iter().any(|token| {
        let is_named = match &token {
            proc_macro2::TokenTree::Ident(one) => !behind_path && (one == ident || one == "Self"),
            proc_macro2::TokenTree::Group(group) => names(group.stream(), ident),
            _ => false,
        };
        behind_path = matches!(&token, proc_macro2::TokenTree::Punct(punct) if punct.as_char() == ':');
        is_named
    })
}

/// A field, however it is named.
struct Members<'a> {
    field: &'a Field,
    name: String,
    member: syn::Member,
    binding: syn::Ident,
    docs: String,
    said: Said,
}

impl<'a> Members<'a> {
    fn of(fields: &'a Fields) -> Result<Vec<Self>> {
        let one = |(index, field): (usize, &'a Field)| {
            plain_serde(&field.attrs)?;
            let said = Said::of(&field.attrs)?;
            let (name, member) = match &field.ident {
                Some(ident) => (ident.unraw().to_string(), ident.clone().into()),
                // One value without a name has that value's own way.
                None if fields.len() == 1 => (String::new(), index.into()),
                None => (format!("[{index}]"), index.into()),
            };
            said.only_of_fields(field.span())?;
            said.fits(&field.ty)?;
            if said.default.is_some() && field.ident.is_none() {
                return Err(Error::new(field.span(), "a field with a default has a name"));
            }
            let docs = docs(&field.attrs);
            Ok(Self { field, name, member, binding: format_ident!("field_{index}"), docs, said })
        };
        fields.iter().enumerate().map(one).collect()
    }

    fn shape(&self) -> TokenStream {
        let ty = &self.field.ty;
        match &self.said.shape {
            Some(shape) => quote! { #shape },
            None => quote! { <#ty as describing::Describe>::SHAPE },
        }
    }

    /// The shape of a field without a name, with what is said of it.
    fn unnamed(&self) -> TokenStream {
        let says = self.said.unit.is_some() || self.said.range.is_some() || self.said.count;
        match self.docs.is_empty() && !says {
            true => self.shape(),
            false => {
                let field = self.described("");
                quote! { describing::Shape::Unnamed(&#field) }
            }
        }
    }

    fn described(&self, name: &str) -> TokenStream {
        let (docs, unit, shape) = (&self.docs, self.said.unit.as_deref().unwrap_or(""), self.shape());
        let default = match &self.said.default {
            Some(default) => quote! { describing::derived::default_of(&#shape, #default) },
            None => quote! { ::core::option::Option::None },
        };
        let range = self.range();
        let range = quote! { describing::derived::range_with(#range, &#shape, &#default) };
        quote! {
            describing::FieldShape {
                name: #name, docs: #docs, unit: #unit, default: #default, range: #range, shape: #shape,
            }
        }
    }

    /// What the field's number may be, as constants.
    fn range(&self) -> TokenStream {
        let (ty, shape) = (&self.field.ty, self.shape());
        let limit = |end: TokenStream| {
            quote! {{ const END: #ty = #end; describing::Limit::of(&#shape, END as f64, END as i128) }}
        };
        let none = || quote! { ::core::option::Option::None };
        let (least, most, below) = match &self.said.range {
            None if self.said.count => {
                let end = quote! { ::core::option::Option::Some(describing::Limit::Integer(describing::MAX_COUNT as i128 + 1)) };
                (none(), none(), end)
            }
            None => return quote! { describing::RangeShape::ALL },
            Some(Expr::Range(range)) => {
                let least = range.start.as_ref().map_or_else(none, |least| limit(quote! { #least }));
                let end = range.end.as_ref().map_or_else(none, |end| limit(quote! { #end }));
                match range.limits {
                    syn::RangeLimits::Closed(_) => (least, end, none()),
                    syn::RangeLimits::HalfOpen(_) => (least, none(), end),
                }
            }
            Some(named) => {
                let end = |end: TokenStream| {
                    limit(quote! {{ const RANGE: ::core::ops::RangeInclusive<#ty> = #named; *RANGE.#end() }})
                };
                (end(quote! { start }), end(quote! { end }), none())
            }
        };
        quote! { describing::RangeShape { least: #least, most: #most, below: #below } }
    }

    fn check(&self) -> TokenStream {
        let (binding, name) = (&self.binding, &self.name);
        let unit = self.said.unit.as_deref().unwrap_or("");
        let range = self.said.range.as_ref().map(|range| {
            quote! {
                describing::derived::range(#name, #binding, #range, #unit)?;
            }
        });
        let longest = self.said.longest.as_ref().map(|longest| {
            quote! {
                describing::derived::longest(#name, #binding.len(), #longest)?;
            }
        });
        let own = self.said.check.as_ref().map(|path| {
            quote! {
                #path(#binding).map_err(|inner| inner.within(#name))?;
            }
        });
        let count = self.said.count.then(|| quote! { describing::derived::count(#name, *#binding)?; });
        let inner = (!self.said.any).then(|| quote! { describing::derived::field(#name, #binding)?; });
        let is_used = !self.said.any || self.said.count || range.is_some() || longest.is_some() || own.is_some();
        let unused = (!is_used).then(|| quote! { let _ = #binding; });
        quote! { #range #longest #count #inner #own #unused }
    }
}

fn fields(all: &[Members<'_>]) -> TokenStream {
    let each = all.iter().map(|one| one.described(&one.name));
    quote! { &[#(#each),*] }
}

fn tuple(all: &[Members<'_>]) -> TokenStream {
    let shapes = all.iter().map(Members::unnamed);
    quote! { describing::Shape::Tuple(&[#(#shapes),*]) }
}

/// What `#[describe(…)]` says.
#[derive(Default)]
struct Said {
    unit: Option<String>,
    range: Option<Expr>,
    longest: Option<Expr>,
    check: Option<Path>,
    shape: Option<Expr>,
    any: bool,
    count: bool,
    default: Option<TokenStream>,
    drawn: Option<syn::LitStr>,
    krate: Option<Path>,
}

impl Said {
    fn of(attributes: &[Attribute]) -> Result<Self> {
        let (mut said, mut names) = (Self::default(), Vec::new());
        for attribute in attributes.iter().filter(|one| one.path().is_ident("describe")) {
            attribute.parse_nested_meta(|meta| {
                let name = meta.path.get_ident().map(ToString::to_string).unwrap_or_default();
                if names.contains(&name) {
                    return Err(meta.error(format!("`{name}` is said twice")));
                }
                names.push(name.clone());
                match name.as_str() {
                    "unit" => said.unit = Some(meta.value()?.parse::<syn::LitStr>()?.value()),
                    "range" => said.range = Some(meta.value()?.parse()?),
                    "longest" => said.longest = Some(meta.value()?.parse()?),
                    "check" => said.check = Some(meta.value()?.parse()?),
                    "shape" => said.shape = Some(meta.value()?.parse()?),
                    "any" => said.any = true,
                    "count" => said.count = true,
                    "default" if meta.input.peek(syn::Token![=]) => {
                        said.default = Some(default(meta.value()?)?);
                    }
                    "default" => {
                        said.default = Some(quote! { describing::DefaultValue::Zero });
                    }
                    "drawn" => said.drawn = Some(drawn(&meta.value()?.parse::<syn::LitStr>()?)?),
                    "crate" => said.krate = Some(meta.value()?.parse()?),
                    _ => {
                        return Err(meta.error(
                            "right are unit, range, longest, count, check, default, shape, any, drawn and crate",
                        ));
                    }
                }
                Ok(())
            })?;
        }
        Ok(said)
    }

    /// Whether what is said can be said of a field of this type, as far as the type's name tells.
    fn fits(&self, ty: &syn::Type) -> Result<()> {
        let outermost = match ty {
            syn::Type::Path(path) => path.path.segments.last().map(|last| last.ident.to_string()).unwrap_or_default(),
            _ => String::new(),
        };
        let is = |names: &[&str]| names.contains(&outermost.as_str());
        if self.range.is_some()
            && (is(&["Option", "Vec", "Box", "String", "bool"]) || !matches!(ty, syn::Type::Path(_)))
        {
            let said = "a range is of a number. Of numbers in an option or a list, make them a type of their own, \
                        `struct Metres(#[describe(range = …)] f64)`, or say `check = function`";
            return Err(Error::new(ty.span(), said));
        }
        let numbers = ["f32", "f64", "u8", "u16", "u32", "u64", "i8", "i16", "i32", "i64", "bool"];
        match self.longest.is_some() && (is(&numbers) || is(&["Option"])) {
            true => Err(Error::new(ty.span(), "`longest` is of a list or a text: of a number say `range`")),
            false => Ok(()),
        }
    }

    /// A field is drawn with its struct.
    fn only_of_fields(&self, span: proc_macro2::Span) -> Result<()> {
        match self.drawn.is_some() || self.krate.is_some() {
            true => Err(Error::new(span, "of a field, describe does not say `drawn` or `crate`; they are its type's")),
            false => Ok(()),
        }
    }

    /// A whole type has none of a field's rules.
    fn only_of_types(&self, span: proc_macro2::Span) -> Result<()> {
        let Self { unit, range, longest, check: _, shape, any, count, default, drawn: _, krate: _ } = self;
        let is_said = unit.is_some() || range.is_some() || longest.is_some() || shape.is_some() || default.is_some();
        match is_said || *any || *count {
            true => {
                Err(Error::new(span, "of a type, describe says `check` and `drawn`; units and ranges are its fields'"))
            }
            false => Ok(()),
        }
    }
}

/// A default, as a constant.
fn default(input: syn::parse::ParseStream<'_>) -> Result<TokenStream> {
    if input.peek(syn::token::Bracket) {
        let inner;
        syn::bracketed!(inner in input);
        let all = inner.parse_terminated(default, syn::Token![,])?.into_iter();
        return Ok(quote! { describing::DefaultValue::List(&[#(#all),*]) });
    }
    let minus: Option<syn::Token![-]> = input.parse()?;
    let literal: Lit = input.parse()?;
    let variant = match &literal {
        Lit::Int(_) => quote! { Integer },
        Lit::Float(_) => quote! { Float },
        Lit::Bool(_) if minus.is_none() => quote! { Bool },
        Lit::Str(_) if minus.is_none() => quote! { Text },
        _ => {
            return Err(Error::new(
                literal.span(),
                "right are numbers, flags, texts, variants' names as texts, and lists",
            ));
        }
    };
    Ok(quote! { describing::DefaultValue::#variant(#minus #literal) })
}

/// As what a struct can be drawn.
fn drawn(word: &syn::LitStr) -> Result<syn::LitStr> {
    match ["points", "pose", "poses", "voxels", "scene"].contains(&word.value().as_str()) {
        true => Ok(word.clone()),
        false => Err(Error::new(word.span(), "right are points, pose, poses, voxels and scene")),
    }
}

/// The doc comment, its lines joined.
fn docs(attributes: &[Attribute]) -> String {
    let line = |attribute: &Attribute| match &attribute.meta {
        Meta::NameValue(said) if said.path.is_ident("doc") => match &said.value {
            Expr::Lit(ExprLit { lit: Lit::Str(text), .. }) => Some(text.value().trim().to_owned()),
            _ => None,
        },
        _ => None,
    };
    attributes.iter().filter_map(line).collect::<Vec<_>>().join(" ").trim().to_owned()
}

/// serde's attributes change what is written, in ways that a description cannot say; but for those that change nothing.
fn plain_serde(attributes: &[Attribute]) -> Result<()> {
    for attribute in attributes.iter().filter(|one| one.path().is_ident("serde")) {
        attribute.parse_nested_meta(|meta| {
            let harmless = ["crate", "borrow", "bound", "deny_unknown_fields", "transparent"];
            if !harmless.iter().any(|name| meta.path.is_ident(name)) {
                return Err(
                    meta.error("a type with this cannot be described: its bytes are not what its definition says")
                );
            }
            if let Ok(value) = meta.value() {
                value.parse::<Expr>()?;
            }
            Ok(())
        })?;
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;

    fn refused(input: DeriveInput) -> String {
        describe(&input).unwrap_err().to_string()
    }

    #[test]
    fn what_cannot_be_said_is_refused_in_words() {
        let range = refused(syn::parse_quote! { struct A { #[describe(range = 0.0..=1.0)] a: Option<f64> } });
        assert!(range.starts_with("a range is of a number"), "{range}");
        let longest = refused(syn::parse_quote! { struct A { #[describe(longest = 3)] a: f64 } });
        assert!(longest.contains("of a number say `range`"), "{longest}");
        let tree = refused(syn::parse_quote! { enum Tree { Leaf, Node(#[describe(longest = 2)] Vec<Tree>) } });
        assert!(tree.contains("lies in itself"), "{tree}");
        assert!(describe(&syn::parse_quote! { struct Tree { other: forest::Tree } }).is_ok());
        let twice =
            refused(syn::parse_quote! { struct A { #[describe(unit = "m", count)] #[describe(unit = "s")] a: u64 } });
        assert_eq!(twice, "`unit` is said twice");
        let unknown = refused(syn::parse_quote! { struct A { #[describe(unti = "m")] a: f64 } });
        assert!(unknown.ends_with("drawn and crate"), "{unknown}");
        let generic =
            travelling(&TokenStream::new(), &syn::parse_quote! { struct A<T> { a: T } }).unwrap_err().to_string();
        assert!(generic.contains("make a payload of a struct with a field"), "{generic}");
    }
}
